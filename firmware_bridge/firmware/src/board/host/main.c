/* The host board: the same core, its UART on a pseudo-terminal, its pins and its clock on stdin and
 * stdout, in lock-step with a simulator. All records are packed and little-endian.
 *
 *   once, out:  64 bytes, the path of the terminal, padded with zeros
 *   step, in:   u32 dt_us, i32 left_ticks, i32 right_ticks, u64 bytes_sent, u16 battery_mv,
 *               i16 current_ma, u8 contacts                                          (25 bytes)
 *   step, out:  i16 left_pwm, i16 right_pwm, u8 brush_pct, u8 fan_pct, u64 bytes_sent (14 bytes)
 *
 * `bytes_sent` counts all bytes that the host has put on the line: they are read before time goes
 * on, however long the kernel takes to deliver them, so a run does not depend on its timing.
 * A step is divided into pieces of at most 5 ms, as the wheel loop needs, unless told otherwise.
 * The firmware ends when stdin does. Usage: firmware [BOOT_NUMBER [LONGEST_PIECE_US]]
 */
#include <stdlib.h>
#include <unistd.h>

#include "board/host/line.h"
#include "core/controller.h"

#define PIECE_US 5000u

/* Hand the core every byte that the host has sent by now. */
static bool take_bytes(struct controller *c, int line, uint64_t *taken, uint64_t sent, uint32_t now)
{
    uint8_t bytes[256];
    while (*taken < sent) {
        uint64_t left = sent - *taken;
        size_t room = (left < sizeof bytes) ? (size_t)left : sizeof bytes;
        ssize_t got = read(line, bytes, room);
        if (got > 0) {
            for (ssize_t i = 0; i < got; i++) {
                controller_receive(c, bytes[i], now);
            }
            *taken += (uint64_t)got;
        } else if (!line_wait(line)) {
            return false;
        } else {
            /* there is something now */
        }
    }
    return true;
}

/* Put what the core has to say on the line; what a full line refuses is lost, as on a UART. */
static uint64_t give_bytes(struct controller *c, int line)
{
    uint8_t bytes[256];
    size_t size = 0;
    while ((size < sizeof bytes) && outbox_take(&c->outbox, &bytes[size])) {
        size++;
    }
    ssize_t put_out = (size > 0u) ? write(line, bytes, size) : 0;
    return (put_out > 0) ? (uint64_t)put_out : 0u;
}

static int32_t between(int32_t start, int32_t end, uint32_t part, uint32_t whole)
{
    int64_t moved = (int32_t)((uint32_t)end - (uint32_t)start);
    return (int32_t)((uint32_t)start + (uint32_t)(moved * (int64_t)part / (int64_t)whole));
}

struct board {
    struct controller controller;
    struct outputs out;
    int32_t left_ticks;
    int32_t right_ticks;
    uint32_t now_us;
    uint64_t taken;
    uint64_t given;
    uint32_t piece_us;
    int line;
};

/* One step of the simulator, in pieces short enough for the wheel loop. */
static bool step(struct board *b, const uint8_t *record)
{
    uint32_t dt_us = (uint32_t)little(&record[0], 4);
    const struct inputs end = {
        .left_ticks = (int32_t)(uint32_t)little(&record[4], 4),
        .right_ticks = (int32_t)(uint32_t)little(&record[8], 4),
        .contacts = record[24],
        .battery_mv = (uint16_t)little(&record[20], 2),
        .current_ma = (int16_t)(uint16_t)little(&record[22], 2),
    };
    uint64_t sent = little(&record[12], 8);
    if (!take_bytes(&b->controller, b->line, &b->taken, sent, b->now_us)) {
        return false;
    }
    uint32_t pieces = (dt_us / b->piece_us) + (((dt_us % b->piece_us) != 0u) ? 1u : 0u);
    uint32_t start_us = b->now_us;
    for (uint32_t i = 1; i <= pieces; i++) {
        struct inputs in = end;
        in.left_ticks = between(b->left_ticks, end.left_ticks, i, pieces);
        in.right_ticks = between(b->right_ticks, end.right_ticks, i, pieces);
        b->now_us = start_us + (uint32_t)(((uint64_t)dt_us * i) / pieces);
        controller_step(&b->controller, &in, b->now_us, &b->out);
        b->given += give_bytes(&b->controller, b->line);
    }
    b->left_ticks = end.left_ticks;
    b->right_ticks = end.right_ticks;
    return true;
}

static unsigned long argument(int argc, char **argv, int at, unsigned long otherwise)
{
    unsigned long value = (argc > at) ? strtoul(argv[at], NULL, 10) : 0u;
    return (value > 0u) ? value : otherwise;
}

int main(int argc, char **argv)
{
    static struct board b;
    uint8_t record[STEP_IN];
    uint8_t answer[STEP_OUT];
    char name[PORT_NAME] = {0};
    const struct identity identity = {
        .board = WIRE_BOARD_HOST,
        .boot = (uint16_t)argument(argc, argv, 1, 1u),
        .build = FIRMWARE_BUILD,
    };
    const struct inputs rest = {.battery_mv = UINT16_MAX};
    b.piece_us = (uint32_t)argument(argc, argv, 2, PIECE_US);
    b.line = line_open(name);
    if ((b.line < 0) || !write_all((const uint8_t *)name, sizeof name)) {
        return EXIT_FAILURE;
    }
    controller_start(&b.controller, &identity, &rest, b.now_us);
    while (read_all(record, sizeof record)) {
        if (!step(&b, record)) {
            return EXIT_FAILURE;
        }
        put(&answer[0], (uint16_t)b.out.left_pwm, 2);
        put(&answer[2], (uint16_t)b.out.right_pwm, 2);
        answer[4] = b.out.brush_pct;
        answer[5] = b.out.fan_pct;
        put(&answer[6], b.given, 8);
        if (!write_all(answer, sizeof answer)) {
            return EXIT_FAILURE;
        }
    }
    return EXIT_SUCCESS;
}
