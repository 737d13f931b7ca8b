/* libFuzzer: a life of the controller, told by the input. Its first byte says whether a session is
 * open from the start; after that a byte below 128 is an instruction with its arguments:
 *   0-31 let (that + 1) ms pass   32-63 change the pins   64-95 raw bytes   96-127 a frame whose
 * CRC is right, so that the fuzzer gets behind it. Anything else is a raw byte for the line. */
#include "bench.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

struct life {
    struct controller c;
    struct inputs in;
    uint32_t now_us;
    const uint8_t *at;
    const uint8_t *end;
};

static uint8_t next(struct life *l)
{
    return (l->at < l->end) ? *l->at++ : 0u;
}

static void receive(struct life *l, uint8_t byte)
{
    controller_receive(&l->c, byte, l->now_us);
}

static void send_frame(struct life *l, const uint8_t *body, uint8_t length)
{
    uint8_t frame[FRAME_MAX_ENCODED];
    uint8_t size = frame_encode(body, length, frame);
    for (uint8_t i = 0; i < size; i++) {
        receive(l, frame[i]);
    }
}

static void pass(struct life *l, unsigned ms)
{
    for (unsigned i = 0; i < ms; i++) {
        struct outputs out;
        l->now_us += 1000u;
        controller_step(&l->c, &l->in, l->now_us, &out);
        bench_drain(&l->c);
        bench_holds(&l->c);
        MUST(out.left_pwm == l->c.left.pwm && out.right_pwm == l->c.right.pwm);
        MUST(out.brush_pct == l->c.brush_pct && out.fan_pct == l->c.fan_pct);
    }
}

static void pins(struct life *l)
{
    l->in.contacts = next(l);
    l->in.left_ticks = (int32_t)((uint32_t)l->in.left_ticks + (uint32_t)(int8_t)next(l));
    l->in.right_ticks = (int32_t)((uint32_t)l->in.right_ticks * (uint32_t)(next(l) | 1u));
    l->in.battery_mv = (uint16_t)(next(l) * 100u);
    l->in.current_ma = (int16_t)((int8_t)next(l) * 100);
}

static void frame(struct life *l)
{
    uint8_t body[WIRE_MAX_BODY];
    uint8_t length = (uint8_t)(1u + (next(l) % WIRE_MAX_BODY));
    for (uint8_t i = 0; i < length; i++) {
        body[i] = next(l);
    }
    bool had_session = l->c.session != 0u;
    bool was_latched = l->c.stop_reason != WIRE_STOP_REASON_NONE;
    send_frame(l, body, length);
    MUST(had_session || !l->c.has_order);
    MUST(!was_latched || !l->c.has_order);
    MUST(had_session || !was_latched || l->c.stop_reason != WIRE_STOP_REASON_NONE);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const uint8_t hello[] = {WIRE_ID_HELLO, 0, 1, 0, WIRE_PROTOCOL_VERSION};
    static const uint8_t clear[] = {WIRE_ID_CLEAR, 1, 1, 0, 1, 0};
    static struct life l;
    l = (struct life){.at = data, .end = data + size, .in = {.battery_mv = 16000}};
    bench_start(&l.c);
    if ((next(&l) & 1u) != 0u) {
        send_frame(&l, hello, sizeof hello);
        send_frame(&l, clear, sizeof clear);
    }
    while (l.at < l.end) {
        uint8_t what = next(&l);
        if (what < 32u) {
            pass(&l, what + 1u);
        } else if (what < 64u) {
            pins(&l);
        } else if (what < 96u) {
            for (unsigned i = 0; i < what - 63u; i++) {
                receive(&l, next(&l));
            }
        } else if (what < 128u) {
            frame(&l);
        } else {
            receive(&l, what);
        }
        bench_drain(&l.c);
        bench_holds(&l.c);
    }
    return 0;
}
