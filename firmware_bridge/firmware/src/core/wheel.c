#include "core/wheel.h"

static int32_t clamp(int32_t value, int32_t limit)
{
    if (value > limit) {
        return limit;
    }
    return (value < -limit) ? -limit : value;
}

void wheel_start(struct wheel *w, int32_t ticks)
{
    for (uint8_t i = 0; i < SPEED_WINDOW; i++) {
        w->past_ticks[i] = ticks;
    }
    w->oldest = 0;
    w->speed_um_s = 0;
    w->um_s_per_pwm = WIRE_FULL_SPEED_MM_S;
    wheel_brake(w);
}

void wheel_brake(struct wheel *w)
{
    w->target_um_s = 0;
    w->setpoint_um_s = 0;
    w->integral = 0;
    w->pwm = 0;
    for (uint8_t i = 0; i < SPEED_WINDOW; i++) {
        w->past_um_s[i] = 0;
    }
}

/* Speed over the window that ends now. */
static void measure(struct wheel *w, int32_t ticks)
{
    int32_t moved = (int32_t)(uint32_t)((uint32_t)ticks - (uint32_t)w->past_ticks[w->oldest]);
    w->past_ticks[w->oldest] = ticks;
    w->speed_um_s = clamp(moved, MAX_WINDOW_TICKS) * UM_S_PER_WINDOW_TICK;
}

/* Mean set-point over the same window, so that measuring late does not look like an error. */
static int32_t expected_um_s(struct wheel *w)
{
    int32_t sum = 0;
    for (uint8_t i = 0; i < SPEED_WINDOW; i++) {
        sum += w->past_um_s[i];
    }
    w->past_um_s[w->oldest] = w->setpoint_um_s;
    w->oldest = (uint8_t)((w->oldest + 1u) % SPEED_WINDOW);
    return sum / (int32_t)SPEED_WINDOW;
}

/* Move the set-point towards the target; returns how far it has moved. */
static int32_t slew(struct wheel *w)
{
    int32_t change = w->target_um_s - w->setpoint_um_s;
    int32_t limit = SPEED_UP_UM_S;
    if (((w->setpoint_um_s > 0) && (change < 0)) || ((w->setpoint_um_s < 0) && (change > 0))) {
        limit = SLOW_DOWN_UM_S;
    }
    int32_t moved = clamp(change, limit);
    w->setpoint_um_s += moved;
    return moved;
}

void wheel_step(struct wheel *w, int32_t ticks)
{
    measure(w, ticks);
    int32_t error = expected_um_s(w) - w->speed_um_s;
    int32_t moved = slew(w);
    if ((w->setpoint_um_s == 0) && (w->target_um_s == 0)) {
        wheel_brake(w);
        return;
    }
    int32_t ahead = w->setpoint_um_s + (moved * LEAD_PERIODS);
    int32_t wanted = (ahead / w->um_s_per_pwm) + (error / w->um_s_per_pwm) +
                     (w->integral / INTEGRAL_ONE);
    int32_t pwm = clamp(wanted, PWM_MAX);
    /* Anti-windup: while the output is at its end, the integral only moves away from it. */
    if ((wanted == pwm) || ((wanted > pwm) != (error > 0))) {
        int32_t more = (error * KI_GAIN) / w->um_s_per_pwm;
        w->integral = clamp(w->integral + more, PWM_MAX * INTEGRAL_ONE);
    }
    w->pwm = (int16_t)pwm;
}
