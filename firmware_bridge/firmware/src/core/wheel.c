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
    wheel_brake(w);
}

void wheel_brake(struct wheel *w)
{
    w->target_um_s = 0;
    w->setpoint_um_s = 0;
    w->integral = 0;
    w->pwm = 0;
}

static void measure(struct wheel *w, int32_t ticks)
{
    int32_t moved = (int32_t)((uint32_t)ticks - (uint32_t)w->past_ticks[w->oldest]);
    w->past_ticks[w->oldest] = ticks;
    w->oldest = (uint8_t)((w->oldest + 1u) % SPEED_WINDOW);
    w->speed_um_s = clamp(moved, MAX_WINDOW_TICKS) * UM_S_PER_WINDOW_TICK;
}

static void slew(struct wheel *w)
{
    int32_t change = w->target_um_s - w->setpoint_um_s;
    int32_t limit = SPEED_UP_UM_S;
    if (((w->setpoint_um_s > 0) && (change < 0)) || ((w->setpoint_um_s < 0) && (change > 0))) {
        limit = SLOW_DOWN_UM_S;
    }
    w->setpoint_um_s += clamp(change, limit);
}

void wheel_step(struct wheel *w, int32_t ticks)
{
    measure(w, ticks);
    slew(w);
    if ((w->setpoint_um_s == 0) && (w->target_um_s == 0)) {
        wheel_brake(w);
        return;
    }
    int32_t error = w->setpoint_um_s - w->speed_um_s;
    int32_t wanted = (w->setpoint_um_s / UM_S_PER_PWM) + (error / KP_UM_S_PER_PWM) +
                     (w->integral / INTEGRAL_ONE);
    int32_t pwm = clamp(wanted, PWM_MAX);
    /* Anti-windup: while the output is at its end, the integral only moves away from it. */
    if ((wanted == pwm) || ((wanted > pwm) != (error > 0))) {
        w->integral = clamp(w->integral + (error / KI_DIVISOR), PWM_MAX * INTEGRAL_ONE);
    }
    w->pwm = (int16_t)pwm;
}
