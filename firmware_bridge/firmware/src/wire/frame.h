/* Frames on the line: COBS(body + CRC-32) + zero. A body is at most WIRE_MAX_BODY bytes, so one
 * COBS block of 254 bytes is never filled. */
#ifndef WIRE_FRAME_H
#define WIRE_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#include "wire/messages.h"

#define FRAME_CRC_SIZE 4u
#define FRAME_MAX_DECODED (WIRE_MAX_BODY + FRAME_CRC_SIZE)
#define FRAME_MAX_ENCODED (FRAME_MAX_DECODED + 2u)

struct frame_decoder {
    uint8_t body[FRAME_MAX_DECODED];
    uint8_t length;      /* decoded so far, CRC included */
    uint8_t block_left;  /* bytes still to come in the COBS block */
    bool started;        /* a code byte has been seen */
    bool broken;         /* too long: wait for the next zero */
    uint16_t frames;     /* counters wrap */
    uint16_t crc_errors;
    uint16_t framing_errors;
};

/* Encode body[0..length) into out (FRAME_MAX_ENCODED bytes); returns the bytes written. */
uint8_t frame_encode(const uint8_t *body, uint8_t length, uint8_t *out);

/* Take one byte; returns the length of a valid body in decoder->body, or 0. */
uint8_t frame_decode(struct frame_decoder *decoder, uint8_t byte);

#endif
