#include "core/reflex.h"

/* Let `lasted_us` count while `on`; true once it reaches the limit. Saturates there. */
static bool lasts(uint32_t *lasted_us, bool on, uint32_t dt_us, uint32_t limit_us)
{
    if (!on) {
        *lasted_us = 0;
        return false;
    }
    if (*lasted_us < limit_us) {
        *lasted_us += (dt_us < limit_us) ? dt_us : limit_us;
    }
    return *lasted_us >= limit_us;
}

static int32_t magnitude(int32_t value)
{
    return (value < 0) ? -value : value;
}

static bool forward(const struct wheel *w)
{
    return (w->target_um_s > 0) || (w->setpoint_um_s > 0);
}

/* Driven, but the encoder does not move that way: blocked, unplugged, or connected backwards (then
 * the loop would push ever harder). */
static bool stalled(const struct wheel *w)
{
    bool ordered = magnitude(w->setpoint_um_s) >= STALL_ORDER_UM_S;
    bool driven = ordered || (magnitude(w->pwm) >= STALL_PWM);
    bool backwards = ordered ? (w->setpoint_um_s < 0) : (w->pwm < 0);
    int32_t along_um_s = backwards ? -w->speed_um_s : w->speed_um_s;
    return driven && (along_um_s < STALL_SPEED_UM_S);
}

uint8_t reflexes_check(struct reflexes *r, const struct inputs *in, const struct wheel *left,
                       const struct wheel *right, uint32_t dt_us)
{
    bool ahead = forward(left) || forward(right);
    bool left_stalls = lasts(&r->stalled_us[0], stalled(left), dt_us, STALL_US);
    bool right_stalls = lasts(&r->stalled_us[1], stalled(right), dt_us, STALL_US);
    bool over_current =
        lasts(&r->over_current_us, in->current_ma >= OVER_CURRENT_MA, dt_us, OVER_CURRENT_US);
    bool low_battery =
        lasts(&r->low_battery_us, in->battery_mv < BROWN_OUT_MV, dt_us, BROWN_OUT_US);
    if ((in->contacts & WIRE_CONTACT_BIT_WHEEL_DROP) != 0u) {
        return WIRE_STOP_REASON_WHEEL_DROP;
    }
    if (ahead && ((in->contacts & CLIFF_BITS) != 0u)) {
        return WIRE_STOP_REASON_CLIFF;
    }
    if (ahead && ((in->contacts & BUMP_BITS) != 0u)) {
        return WIRE_STOP_REASON_BUMP;
    }
    if (over_current) {
        return WIRE_STOP_REASON_OVER_CURRENT;
    }
    if (low_battery) {
        return WIRE_STOP_REASON_BROWN_OUT;
    }
    return (left_stalls || right_stalls) ? WIRE_STOP_REASON_STALL : WIRE_STOP_REASON_NONE;
}

bool reflexes_block_clear(const struct inputs *in)
{
    return ((in->contacts & WIRE_CONTACT_BIT_WHEEL_DROP) != 0u) ||
           (in->current_ma >= OVER_CURRENT_MA) || (in->battery_mv < BROWN_OUT_MV);
}
