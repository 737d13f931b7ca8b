/* Both quadrature encoders by one pin-change interrupt: every edge of A and B counts. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "board/atmega328p/parts.h"
#include "board/atmega328p/pins.h"

/* [before << 2 | now] of the two bits BA; a jump over two edges counts nothing. */
static const int8_t moved[16] = {0, 1, -1, 0, -1, 0, 0, 1, 1, 0, 0, -1, 0, -1, 1, 0};

static volatile int32_t left_ticks;
static volatile int32_t right_ticks;
static uint8_t left_before;
static uint8_t right_before;

static uint8_t left_bits(uint8_t pins)
{
    return (uint8_t)((pins >> LEFT_A) & 3u); /* A and B are neighbours */
}

static uint8_t right_bits(uint8_t pins)
{
    return (uint8_t)(((pins >> RIGHT_A) & 1u) | ((pins >> (RIGHT_B - 1)) & 2u));
}

ISR(PCINT2_vect)
{
    uint8_t pins = PIND;
    uint8_t left = left_bits(pins);
    uint8_t right = right_bits(pins);
    left_ticks += moved[(uint8_t)((left_before << 2) | left)];
    right_ticks += moved[(uint8_t)((right_before << 2) | right)];
    left_before = left;
    right_before = right;
}

void encoders_start(void)
{
    uint8_t pins = (uint8_t)(_BV(LEFT_A) | _BV(LEFT_B) | _BV(RIGHT_A) | _BV(RIGHT_B));
    PORTD = (uint8_t)(PORTD | pins); /* pull-ups, for open-collector encoders */
    left_before = left_bits(PIND);
    right_before = right_bits(PIND);
    PCMSK2 = pins; /* PCINT16 + n is PDn */
    PCICR = (uint8_t)(PCICR | _BV(PCIE2));
}

void encoders_read(int32_t *left, int32_t *right)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        *left = left_ticks;
        *right = right_ticks;
    }
}
