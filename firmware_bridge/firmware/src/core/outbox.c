#include "core/outbox.h"

#include "wire/frame.h"

static bool queue(struct ring *ring, const uint8_t *body, uint8_t length)
{
    uint8_t frame[FRAME_MAX_ENCODED];
    uint8_t size = frame_encode(body, length, frame);
    uint8_t head = ring->head;
    uint8_t free_bytes = (uint8_t)((unsigned)ring->tail - head - 1u);
    if (size > free_bytes) {
        return false;
    }
    for (uint8_t i = 0; i < size; i++) {
        ring->bytes[head] = frame[i];
        head++;
    }
    ring->head = head; /* only now can the reader see it, whole */
    return true;
}

void outbox_answer(struct outbox *box, const uint8_t *body, uint8_t length)
{
    if (!queue(&box->answers, body, length)) {
        box->dropped++;
    }
}

void outbox_stream(struct outbox *box, const uint8_t *body, uint8_t length)
{
    if (!queue(&box->telemetry, body, length)) {
        box->dropped++;
    }
}

static bool take(struct ring *ring, uint8_t *byte)
{
    uint8_t tail = ring->tail;
    if (tail == ring->head) {
        return false;
    }
    *byte = ring->bytes[tail];
    ring->tail = (uint8_t)(tail + 1u);
    return true;
}

bool outbox_take(struct outbox *box, uint8_t *byte)
{
    if (!box->in_telemetry && take(&box->answers, byte)) {
        return true;
    }
    if (!take(&box->telemetry, byte)) {
        return false;
    }
    box->in_telemetry = *byte != 0u; /* a zero ends the frame */
    return true;
}
