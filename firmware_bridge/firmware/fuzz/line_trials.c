/* Orders over a bad line, as fast as this computer can; no host, no waiting.
 *
 *   line-trials noise PPM BYTES SEED    orders garbled on the way: flipped, dropped, doubled and
 *                                       inserted bytes, PPM millionths of all in equal parts
 *   line-trials bursts MS BYTES SEED    the line is noise for MS at random times (115200 baud)
 *   line-trials random FRAMES SEED      random frames without a session, half of them with a right
 *                                       CRC; none is a Hello
 *
 * Prints what came through. It ends with 1 if an order was carried out that was never sent. */
#include <string.h>

#include "bench.h"

#define BYTES_PER_MS 12u
#define GAP_MS 3000u

static uint64_t state;

/* xorshift64*: Vigna, "An experimental exploration of Marsaglia's xorshift generators", 2016. */
static uint32_t draw(void)
{
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return (uint32_t)((state * 0x2545F4914F6CDD1Du) >> 32);
}

static uint32_t below(uint32_t limit)
{
    return (uint32_t)(((uint64_t)draw() * limit) >> 32);
}

static uint32_t mix(uint32_t value)
{
    value ^= value >> 16;
    value *= 0x7FEB352Du;
    value ^= value >> 15;
    value *= 0x846CA68Bu;
    return value ^ (value >> 16);
}

struct order {
    int16_t left, right;
    uint8_t brush, fan;
    uint16_t valid;
};

/* Every order that is ever sent follows from one number of 16 bits. */
static struct order order_of(uint32_t number)
{
    uint32_t a = mix(number + 1u), b = mix(a);
    return (struct order){
        .left = (int16_t)((int)(a % 1001u) - 500),
        .right = (int16_t)((int)((a >> 12) % 1001u) - 500),
        .brush = (uint8_t)(b % 101u),
        .fan = (uint8_t)((b >> 8) % 101u),
        .valid = (uint16_t)(1u + ((b >> 16) % 1000u)),
    };
}

static uint8_t sent_before[1u << 16];

/* Was the order that the controller holds ever sent? */
static bool known(const struct controller *c)
{
    for (uint32_t n = 0; n < (1u << 16); n++) {
        struct order o = order_of(n);
        if (sent_before[n] && (o.left * 1000 == c->left.target_um_s) &&
            (o.right * 1000 == c->right.target_um_s) && (o.brush == c->brush_pct) &&
            (o.fan == c->fan_pct) && (o.valid * 1000u == c->order_valid_us)) {
            return true;
        }
    }
    return false;
}

struct trial {
    struct controller c;
    uint32_t now_us;
    uint64_t bytes, hurt, executed, wrong;
    uint32_t noise_ppm;
    uint32_t last; /* number of the last order sent: nearly always the one that is held */
};

static bool holds(const struct trial *t, uint32_t number)
{
    struct order o = order_of(number);
    return (o.left * 1000 == t->c.left.target_um_s) && (o.right * 1000 == t->c.right.target_um_s) &&
           (o.brush == t->c.brush_pct) && (o.fan == t->c.fan_pct) &&
           (o.valid * 1000u == t->c.order_valid_us);
}

static void receive(struct trial *t, uint8_t byte)
{
    t->c.has_order = false; /* so that taking one shows */
    controller_receive(&t->c, byte, t->now_us);
    if (t->c.has_order) {
        t->executed++;
        t->wrong += (holds(t, t->last) || known(&t->c)) ? 0u : 1u;
    }
    bench_drain(&t->c);
}

static void over_the_line(struct trial *t, uint8_t byte)
{
    t->bytes++;
    if (below(1000000u) >= t->noise_ppm) {
        receive(t, byte);
        return;
    }
    t->hurt++;
    switch (below(4u)) {
    case 0u:
        receive(t, (uint8_t)(byte ^ (1u << below(8u))));
        break;
    case 1u:
        break;
    case 2u:
        receive(t, byte);
        receive(t, byte);
        break;
    default:
        receive(t, byte);
        receive(t, (uint8_t)draw());
        break;
    }
}

static void send_body(struct trial *t, const uint8_t *body, uint8_t length)
{
    uint8_t frame[FRAME_MAX_ENCODED];
    uint8_t size = frame_encode(body, length, frame);
    for (uint8_t i = 0; i < size; i++) {
        over_the_line(t, frame[i]);
    }
}

static void open_session(struct trial *t)
{
    static const uint8_t hello[] = {WIRE_ID_HELLO, 0, 1, 0, WIRE_PROTOCOL_VERSION};
    uint8_t clear[] = {WIRE_ID_CLEAR, 1, 1, 0, 0, 0};
    t->noise_ppm = 0;
    bench_start(&t->c);
    send_body(t, hello, sizeof hello);
    clear[4] = (uint8_t)t->c.latch;
    send_body(t, clear, sizeof clear);
    MUST(t->c.stop_reason == WIRE_STOP_REASON_NONE);
}

static void send_order(struct trial *t)
{
    uint32_t number = below(1u << 16);
    struct order o = order_of(number);
    const uint8_t body[] = {
        WIRE_ID_DRIVE,     (uint8_t)number,         1,
        0,                 (uint8_t)o.left,         (uint8_t)((uint16_t)o.left >> 8),
        (uint8_t)o.right,  (uint8_t)((uint16_t)o.right >> 8), o.brush,
        o.fan,             (uint8_t)o.valid,        (uint8_t)(o.valid >> 8),
    };
    sent_before[number] = 1;
    t->last = number;
    send_body(t, body, sizeof body);
}

static int report(const struct trial *t, const char *what)
{
    printf("%s: %llu bytes, %llu hurt, %llu orders carried out, %llu wrong, %u frames with a wrong "
           "CRC, %u no frames (counters of 16 bits)\n",
           what, (unsigned long long)t->bytes, (unsigned long long)t->hurt,
           (unsigned long long)t->executed, (unsigned long long)t->wrong, t->c.decoder.crc_errors,
           t->c.decoder.framing_errors);
    return (t->wrong == 0u) ? EXIT_SUCCESS : EXIT_FAILURE;
}

static int noise(uint32_t ppm, uint64_t bytes)
{
    static struct trial t;
    open_session(&t);
    t.noise_ppm = ppm;
    while (t.bytes < bytes) {
        send_order(&t);
    }
    return report(&t, "noise");
}

static int bursts(uint32_t burst_ms, uint64_t bytes)
{
    static struct trial t;
    open_session(&t);
    while (t.bytes < bytes) {
        for (uint64_t end = t.bytes + (uint64_t)below(GAP_MS) * BYTES_PER_MS; t.bytes < end;) {
            send_order(&t);
        }
        for (uint32_t i = 0; i < burst_ms * BYTES_PER_MS; i++) {
            t.bytes++;
            t.hurt++;
            receive(&t, (uint8_t)draw());
        }
    }
    return report(&t, "bursts");
}

static int random_frames(uint64_t frames)
{
    static struct trial t;
    bench_start(&t.c);
    for (uint64_t n = 0; n < frames; n++) {
        uint8_t body[WIRE_MAX_BODY];
        uint8_t length = (uint8_t)(1u + below(WIRE_MAX_BODY));
        if ((draw() & 1u) == 0u) {
            t.bytes += length + 1u;
            for (uint8_t i = 0; i < length; i++) {
                receive(&t, (uint8_t)draw());
            }
            receive(&t, 0);
        } else {
            static const uint8_t sizes[] = {WIRE_SIZE_DRIVE, WIRE_SIZE_STOP, WIRE_SIZE_CLEAR};
            uint8_t which = (uint8_t)below(4u);
            if (which < 3u) {
                length = (uint8_t)(WIRE_HEADER_SIZE + sizes[which]);
            }
            for (uint8_t i = 0; i < length; i++) {
                body[i] = (uint8_t)draw();
            }
            body[0] = (which < 3u) ? (uint8_t)(WIRE_ID_DRIVE + which) : (uint8_t)(body[0] | 2u);
            send_body(&t, body, length);
        }
        MUST(t.c.session == 0u && t.c.stop_reason == WIRE_STOP_REASON_RESET);
    }
    t.wrong = t.executed;
    printf("%llu frames; ", (unsigned long long)frames);
    return report(&t, "random");
}

int main(int argc, char **argv)
{
    uint64_t seed = (argc > 1) ? strtoull(argv[argc - 1], NULL, 10) : 0u;
    state = (seed * 0x9E3779B97F4A7C15u) | 1u;
    if ((argc == 5) && (strcmp(argv[1], "noise") == 0)) {
        return noise((uint32_t)strtoul(argv[2], NULL, 10), strtoull(argv[3], NULL, 10));
    }
    if ((argc == 5) && (strcmp(argv[1], "bursts") == 0)) {
        return bursts((uint32_t)strtoul(argv[2], NULL, 10), strtoull(argv[3], NULL, 10));
    }
    if ((argc == 4) && (strcmp(argv[1], "random") == 0)) {
        return random_frames(strtoull(argv[2], NULL, 10));
    }
    fprintf(stderr, "usage: line-trials noise PPM BYTES SEED | bursts MS BYTES SEED | "
                    "random FRAMES SEED\n");
    return 2;
}
