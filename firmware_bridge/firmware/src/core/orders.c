#include "core/orders.h"

#include "core/telemetry.h"

static int32_t um_s(int16_t mm_s)
{
    return (int32_t)mm_s * 1000;
}

static bool in_range(int16_t mm_s)
{
    return (mm_s <= WIRE_MAX_WHEEL_MM_S) && (mm_s >= -WIRE_MAX_WHEEL_MM_S);
}

/* A repeated Hello of the open session only keeps it (as Keep does); any other one begins a session without an
 * order, and a machine found moving is stopped and stays so until somebody clears it. */
static void hello(struct controller *c, const uint8_t *fields, uint8_t seq, uint16_t session,
                  uint32_t now_us)
{
    struct wire_hello message;
    wire_unpack_hello(fields, &message);
    if ((session == 0u) || (message.protocol != (uint8_t)WIRE_PROTOCOL_VERSION)) {
        c->refused++;
        telemetry_hello_ack(c, seq, 0, now_us);
        return;
    }
    if (session != c->session) {
        if (c->has_order) {
            controller_stop(c, WIRE_STOP_REASON_LINK_LOST);
        }
        c->session = session;
        c->timers.all_due = true;
    }
    c->heard_us = now_us;
    telemetry_hello_ack(c, seq, c->session, now_us);
}

static uint8_t drive(struct controller *c, const uint8_t *fields, uint32_t now_us)
{
    struct wire_drive order;
    wire_unpack_drive(fields, &order);
    if (!in_range(order.left_mm_s) || !in_range(order.right_mm_s) || (order.brush_pct > 100u) ||
        (order.fan_pct > 100u) || (order.valid_for_ms == 0u) ||
        (order.valid_for_ms > WIRE_MAX_VALID_FOR_MS)) {
        return WIRE_RESULT_OUT_OF_RANGE;
    }
    if (c->stop_reason != WIRE_STOP_REASON_NONE) {
        return WIRE_RESULT_LATCHED;
    }
    c->has_order = true;
    c->order_us = now_us;
    c->order_valid_us = order.valid_for_ms * US_PER_MS;
    c->left.target_um_s = um_s(order.left_mm_s);
    c->right.target_um_s = um_s(order.right_mm_s);
    c->brush_pct = order.brush_pct;
    c->fan_pct = order.fan_pct;
    return WIRE_RESULT_OK;
}

/* The host's stop outranks the reason that is latched: a Clear under way for that must not undo
 * it. Said again, it changes nothing. */
static uint8_t stop(struct controller *c)
{
    if (c->stop_reason != WIRE_STOP_REASON_HOST) {
        c->stop_reason = WIRE_STOP_REASON_NONE;
        controller_stop(c, WIRE_STOP_REASON_HOST);
    }
    return WIRE_RESULT_OK;
}

/* Clearing names the stop that the host has seen, so a repeated or late Clear does no harm. */
static uint8_t clear(struct controller *c, const uint8_t *fields)
{
    struct wire_clear order;
    wire_unpack_clear(fields, &order);
    if (order.latch != c->latch) {
        return WIRE_RESULT_WRONG_LATCH;
    }
    if (c->stop_reason == WIRE_STOP_REASON_NONE) {
        return WIRE_RESULT_OK;
    }
    if (reflexes_block_clear(&c->in)) {
        return WIRE_RESULT_BLOCKED;
    }
    c->stop_reason = WIRE_STOP_REASON_NONE;
    return WIRE_RESULT_OK;
}

/* Other motors, only between orders: no wheel's loop changes under way. */
static uint8_t tune(struct controller *c, const uint8_t *fields)
{
    struct wire_tune order;
    wire_unpack_tune(fields, &order);
    if ((order.full_speed_mm_s < WIRE_MIN_FULL_SPEED_MM_S) ||
        (order.full_speed_mm_s > WIRE_MAX_FULL_SPEED_MM_S)) {
        return WIRE_RESULT_OUT_OF_RANGE;
    }
    if (c->has_order) {
        return WIRE_RESULT_BLOCKED;
    }
    c->left.um_s_per_pwm = order.full_speed_mm_s; /* mm/s at 1000 permille: um/s a permille */
    c->right.um_s_per_pwm = order.full_speed_mm_s;
    return WIRE_RESULT_OK;
}

void orders_take(struct controller *c, const uint8_t *body, uint8_t length, uint32_t now_us)
{
    const uint8_t *fields = &body[WIRE_HEADER_SIZE];
    uint8_t size = (uint8_t)(length - WIRE_HEADER_SIZE);
    uint8_t id = body[0];
    uint8_t seq = body[1];
    uint16_t session = (uint16_t)(body[2] | ((uint16_t)body[3] << 8));
    uint8_t result;
    if ((id == WIRE_ID_HELLO) && (size == WIRE_SIZE_HELLO)) {
        hello(c, fields, seq, session, now_us);
        return;
    }
    if ((c->session == 0u) || (session != c->session)) {
        c->refused++;
        telemetry_ack(c, seq, WIRE_RESULT_NO_SESSION, now_us);
        return;
    }
    c->heard_us = now_us;
    if ((id == WIRE_ID_DRIVE) && (size == WIRE_SIZE_DRIVE)) {
        result = drive(c, fields, now_us);
    } else if ((id == WIRE_ID_STOP) && (size == WIRE_SIZE_STOP)) {
        result = stop(c);
    } else if ((id == WIRE_ID_CLEAR) && (size == WIRE_SIZE_CLEAR)) {
        result = clear(c, fields);
    } else if ((id == WIRE_ID_KEEP) && (size == WIRE_SIZE_KEEP)) {
        result = WIRE_RESULT_OK;
    } else if ((id == WIRE_ID_TUNE) && (size == WIRE_SIZE_TUNE)) {
        result = tune(c, fields);
    } else {
        result = WIRE_RESULT_UNKNOWN;
    }
    if (result != WIRE_RESULT_OK) {
        c->refused++;
    }
    telemetry_ack(c, seq, result, now_us);
}
