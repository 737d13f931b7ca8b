#include "core/telemetry.h"

static void head(uint8_t *body, uint8_t id, uint8_t seq, uint16_t session)
{
    body[0] = id;
    body[1] = seq;
    body[2] = (uint8_t)session;
    body[3] = (uint8_t)(session >> 8);
}

void telemetry_hello_ack(struct controller *c, uint8_t seq, uint16_t session, uint32_t now_us)
{
    uint8_t body[WIRE_MAX_BODY];
    const struct wire_hello_ack message = {
        .time_us = now_us,
        .protocol = (uint8_t)WIRE_PROTOCOL_VERSION,
        .board = c->identity.board,
        .boot = c->identity.boot,
        .build = c->identity.build,
        .stop_reason = c->stop_reason,
        .latch = c->latch,
    };
    wire_pack_hello_ack(&body[WIRE_HEADER_SIZE], &message);
    head(body, WIRE_ID_HELLO_ACK, seq, session);
    outbox_answer(&c->outbox, body, WIRE_HEADER_SIZE + WIRE_SIZE_HELLO_ACK);
}

void telemetry_ack(struct controller *c, uint8_t order, uint8_t result, uint32_t now_us)
{
    uint8_t body[WIRE_MAX_BODY];
    const struct wire_ack message = {
        .time_us = now_us,
        .order = order,
        .result = result,
        .stop_reason = c->stop_reason,
        .latch = c->latch,
    };
    uint16_t session = (result == WIRE_RESULT_NO_SESSION) ? 0u : c->session;
    wire_pack_ack(&body[WIRE_HEADER_SIZE], &message);
    head(body, WIRE_ID_ACK, c->out_seq, session);
    outbox_answer(&c->outbox, body, WIRE_HEADER_SIZE + WIRE_SIZE_ACK);
    c->out_seq++;
}

static void stream(struct controller *c, uint8_t *body, uint8_t id, uint8_t fields_size)
{
    head(body, id, c->out_seq, c->session);
    outbox_stream(&c->outbox, body, (uint8_t)(WIRE_HEADER_SIZE + fields_size));
    c->out_seq++;
}

static void send_wheels(struct controller *c, uint32_t now_us)
{
    uint8_t body[WIRE_MAX_BODY];
    const struct wire_wheels message = {
        .time_us = now_us,
        .left_ticks = c->in.left_ticks,
        .right_ticks = c->in.right_ticks,
    };
    wire_pack_wheels(&body[WIRE_HEADER_SIZE], &message);
    stream(c, body, WIRE_ID_WHEELS, WIRE_SIZE_WHEELS);
}

static void send_contacts(struct controller *c, uint32_t now_us)
{
    uint8_t body[WIRE_MAX_BODY];
    const struct wire_contacts message = {.time_us = now_us, .bits = c->in.contacts};
    wire_pack_contacts(&body[WIRE_HEADER_SIZE], &message);
    stream(c, body, WIRE_ID_CONTACTS, WIRE_SIZE_CONTACTS);
    c->timers.contacts = c->in.contacts;
}

static void send_power(struct controller *c, uint32_t now_us)
{
    uint8_t body[WIRE_MAX_BODY];
    const struct wire_power message = {
        .time_us = now_us,
        .battery_mv = c->in.battery_mv,
        .current_ma = c->in.current_ma,
        .charging = ((c->in.contacts & WIRE_CONTACT_BIT_CHARGING) != 0u) ? 1u : 0u,
    };
    wire_pack_power(&body[WIRE_HEADER_SIZE], &message);
    stream(c, body, WIRE_ID_POWER, WIRE_SIZE_POWER);
}

static void send_status(struct controller *c, uint32_t now_us)
{
    uint8_t body[WIRE_MAX_BODY];
    const struct wire_status message = {
        .time_us = now_us,
        .state = controller_state(c),
        .stop_reason = c->stop_reason,
        .latch = c->latch,
        .frames = c->decoder.frames,
        .crc_errors = c->decoder.crc_errors,
        .framing_errors = c->decoder.framing_errors,
        .refused = c->refused,
        .expired = c->expired,
        .dropped = c->outbox.dropped,
    };
    wire_pack_status(&body[WIRE_HEADER_SIZE], &message);
    stream(c, body, WIRE_ID_STATUS, WIRE_SIZE_STATUS);
    c->timers.state = message.state;
    c->timers.stop_reason = message.stop_reason;
}

/* Is it time again? Messages keep to multiples of their period on the controller's clock. */
static bool due(uint32_t *last_us, uint32_t now_us, int32_t period_ms)
{
    uint32_t period_us = (uint32_t)period_ms * US_PER_MS;
    if ((now_us - *last_us) < period_us) {
        return false;
    }
    *last_us = now_us - (now_us % period_us);
    return true;
}

/* Has it changed, and was it not sent just now? Then its period begins anew. */
static bool changed(uint32_t *last_us, uint32_t now_us, bool differs, uint32_t gap_us)
{
    if (!differs || ((now_us - *last_us) < gap_us)) {
        return false;
    }
    *last_us = now_us;
    return true;
}

void telemetry_send(struct controller *c, uint32_t now_us)
{
    struct timers *t = &c->timers;
    if (c->session == 0u) {
        return;
    }
    if (t->all_due) {
        t->all_due = false;
        t->wheels_us = now_us - ((uint32_t)WIRE_WHEELS_PERIOD_MS * US_PER_MS);
        t->contacts_us = now_us - ((uint32_t)WIRE_CONTACTS_PERIOD_MS * US_PER_MS);
        t->power_us = now_us - ((uint32_t)WIRE_POWER_PERIOD_MS * US_PER_MS);
        t->status_us = now_us - ((uint32_t)WIRE_STATUS_PERIOD_MS * US_PER_MS);
    }
    bool contacts_differ = t->contacts != c->in.contacts;
    bool status_differs =
        (t->state != controller_state(c)) || (t->stop_reason != c->stop_reason);
    if (due(&t->wheels_us, now_us, WIRE_WHEELS_PERIOD_MS)) {
        send_wheels(c, now_us);
    }
    if (changed(&t->contacts_us, now_us, contacts_differ, CONTACTS_MIN_GAP_US) ||
        due(&t->contacts_us, now_us, WIRE_CONTACTS_PERIOD_MS)) {
        send_contacts(c, now_us);
    }
    if (changed(&t->status_us, now_us, status_differs, STATUS_MIN_GAP_US) ||
        due(&t->status_us, now_us, WIRE_STATUS_PERIOD_MS)) {
        send_status(c, now_us);
    }
    if (due(&t->power_us, now_us, WIRE_POWER_PERIOD_MS)) {
        send_power(c, now_us);
    }
}
