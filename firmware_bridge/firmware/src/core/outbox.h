/* Bytes waiting for the line, in two queues: answers to orders go first, telemetry when there are
 * none; a frame that has begun ends before another one does. One writer (the core), one reader (the
 * board, maybe an interrupt): the indices are single bytes that wrap by themselves, so neither side
 * needs a lock; all of it is volatile, so that no byte is written after the index that shows it. */
#ifndef CORE_OUTBOX_H
#define CORE_OUTBOX_H

#include <stdbool.h>
#include <stdint.h>

struct ring {
    volatile uint8_t head;
    volatile uint8_t tail;
    volatile uint8_t bytes[256];
};

struct outbox {
    struct ring answers;
    struct ring telemetry;
    bool in_telemetry; /* the reader is inside a frame of telemetry */
    uint16_t dropped;  /* frames that did not fit; wraps */
};

/* Frame a body and queue it whole, or drop it whole. */
void outbox_answer(struct outbox *box, const uint8_t *body, uint8_t length);
void outbox_stream(struct outbox *box, const uint8_t *body, uint8_t length);

/* Take the next byte; false when there is none. */
bool outbox_take(struct outbox *box, uint8_t *byte);

#endif
