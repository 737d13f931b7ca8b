#include "core/outbox.h"

#include "wire/frame.h"

void outbox_send(struct outbox *box, const uint8_t *body, uint8_t length)
{
    uint8_t frame[FRAME_MAX_ENCODED];
    uint8_t size = frame_encode(body, length, frame);
    uint8_t head = box->head;
    uint8_t free_bytes = (uint8_t)((unsigned)box->tail - head - 1u);
    if (size > free_bytes) {
        box->dropped++;
        return;
    }
    for (uint8_t i = 0; i < size; i++) {
        box->bytes[head] = frame[i];
        head++;
    }
    box->head = head;
}

bool outbox_take(struct outbox *box, uint8_t *byte)
{
    uint8_t tail = box->tail;
    if (tail == box->head) {
        return false;
    }
    *byte = box->bytes[tail];
    box->tail = (uint8_t)(tail + 1u);
    return true;
}
