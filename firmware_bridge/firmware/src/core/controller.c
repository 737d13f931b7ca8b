#include "core/controller.h"

#include "core/orders.h"
#include "core/telemetry.h"

void controller_start(struct controller *c, const struct identity *identity,
                      const struct inputs *in, uint32_t now_us)
{
    static const struct controller zero = {.session = 0};
    *c = zero;
    c->identity = *identity;
    c->in = *in;
    c->step_us = now_us;
    c->control_us = now_us;
    wheel_start(&c->left, in->left_ticks);
    wheel_start(&c->right, in->right_ticks);
    controller_stop(c, WIRE_STOP_REASON_RESET);
}

void controller_stop(struct controller *c, uint8_t reason)
{
    c->has_order = false;
    c->brush_pct = 0;
    c->fan_pct = 0;
    wheel_brake(&c->left);
    wheel_brake(&c->right);
    if (c->stop_reason == WIRE_STOP_REASON_NONE) {
        c->stop_reason = reason;
        c->latch++;
    }
}

uint8_t controller_state(const struct controller *c)
{
    if (c->session == 0u) {
        return WIRE_STATE_NO_SESSION;
    }
    if (c->stop_reason != WIRE_STOP_REASON_NONE) {
        return WIRE_STATE_LATCHED;
    }
    return c->has_order ? WIRE_STATE_DRIVING : WIRE_STATE_READY;
}

void controller_receive(struct controller *c, uint8_t byte, uint32_t now_us)
{
    uint8_t length = frame_decode(&c->decoder, byte);
    if (length >= WIRE_HEADER_SIZE) {
        orders_take(c, c->decoder.body, length, now_us);
    }
}

/* An order ends by itself: standing still may just end, moving must not, so that latches. Wheels
 * that are still slowing down brake: without an order nothing is driven. */
static void expire(struct controller *c, uint32_t now_us)
{
    if (c->has_order && ((now_us - c->order_us) >= c->order_valid_us)) {
        c->expired++;
        if ((c->left.target_um_s != 0) || (c->right.target_um_s != 0)) {
            controller_stop(c, WIRE_STOP_REASON_EXPIRED);
        } else {
            c->has_order = false;
            c->brush_pct = 0;
            c->fan_pct = 0;
            wheel_brake(&c->left);
            wheel_brake(&c->right);
        }
    }
}

static void watch(struct controller *c, uint32_t now_us, uint32_t dt_us)
{
    if (c->has_order && (dt_us > OVERRUN_US)) {
        controller_stop(c, WIRE_STOP_REASON_OVERRUN);
    }
    expire(c, now_us);
    if ((c->session != 0u) &&
        ((now_us - c->heard_us) >= ((uint32_t)WIRE_LINK_TIMEOUT_MS * US_PER_MS))) {
        c->session = 0;
        controller_stop(c, WIRE_STOP_REASON_LINK_LOST);
    }
    uint8_t reason = reflexes_check(&c->reflexes, &c->in, &c->left, &c->right, dt_us);
    if (reason != WIRE_STOP_REASON_NONE) {
        controller_stop(c, reason);
    }
}

static void control(struct controller *c, uint32_t now_us)
{
    uint32_t late_us = now_us - c->control_us;
    if (late_us < CONTROL_PERIOD_US) {
        return;
    }
    c->control_us = (late_us < (2u * CONTROL_PERIOD_US)) ? (c->control_us + CONTROL_PERIOD_US)
                                                         : now_us;
    wheel_step(&c->left, c->in.left_ticks);
    wheel_step(&c->right, c->in.right_ticks);
}

void controller_step(struct controller *c, const struct inputs *in, uint32_t now_us,
                     struct outputs *out)
{
    uint32_t dt_us = now_us - c->step_us;
    c->step_us = now_us;
    c->in = *in;
    watch(c, now_us, dt_us);
    control(c, now_us);
    out->left_pwm = c->left.pwm;
    out->right_pwm = c->right.pwm;
    out->brush_pct = c->brush_pct;
    out->fan_pct = c->fan_pct;
    telemetry_send(c, now_us);
}
