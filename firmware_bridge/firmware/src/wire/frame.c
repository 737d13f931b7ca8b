#include "wire/frame.h"

#include "wire/crc32.h"

uint8_t frame_encode(const uint8_t *body, uint8_t length, uint8_t *out)
{
    uint32_t crc = crc32(body, length);
    uint8_t code_at = 0;
    uint8_t at = 1;
    for (uint8_t i = 0; i < (length + FRAME_CRC_SIZE); i++) {
        uint8_t byte;
        if (i < length) {
            byte = body[i];
        } else {
            byte = (uint8_t)crc;
            crc >>= 8;
        }
        if (byte != 0u) {
            out[at] = byte;
        } else {
            out[code_at] = (uint8_t)(at - code_at);
            code_at = at;
        }
        at++;
    }
    out[code_at] = (uint8_t)(at - code_at);
    out[at] = 0;
    return (uint8_t)(at + 1u);
}

static void restart(struct frame_decoder *d)
{
    d->length = 0;
    d->block_left = 0;
    d->started = false;
    d->broken = false;
}

static void append(struct frame_decoder *d, uint8_t byte)
{
    if (d->length < FRAME_MAX_DECODED) {
        d->body[d->length] = byte;
        d->length++;
    } else {
        d->broken = true;
    }
}

/* A zero has come: is what stands in the buffer a frame? */
static uint8_t finish(struct frame_decoder *d)
{
    uint8_t body_length = 0;
    if (!d->started) {
        return 0; /* zeros between frames mean nothing */
    }
    if (d->broken || (d->block_left != 0u) || (d->length <= FRAME_CRC_SIZE)) {
        d->framing_errors++;
    } else {
        uint8_t length = (uint8_t)(d->length - FRAME_CRC_SIZE);
        uint32_t crc = crc32(d->body, length);
        bool same = true;
        for (uint8_t i = 0; i < FRAME_CRC_SIZE; i++) {
            same = same && (d->body[length + i] == (uint8_t)(crc >> (8u * (uint32_t)i)));
        }
        if (same) {
            d->frames++;
            body_length = length;
        } else {
            d->crc_errors++;
        }
    }
    restart(d);
    return body_length;
}

uint8_t frame_decode(struct frame_decoder *d, uint8_t byte)
{
    if (byte == 0u) {
        return finish(d);
    }
    if (d->broken) {
        return 0;
    }
    if (d->block_left == 0u) {
        if (d->started) {
            append(d, 0); /* the zero that ended the last block */
        }
        d->started = true;
        d->block_left = (uint8_t)(byte - 1u);
    } else {
        append(d, byte);
        d->block_left--;
    }
    return 0;
}
