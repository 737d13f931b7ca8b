/* Cliff sensors, battery and motor current: one conversion after the other, 104 us each. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "board/atmega328p/parts.h"
#include "board/atmega328p/pins.h"
#include "wire/messages.h"

#define CHANNELS 6u
#define STALE_READS 10u /* a round takes 0.6 ms; so many reads without one: the ADC is dead */
#define CLIFF_ABOVE 600u   /* no echo: the phototransistor's pull-up wins, as with a broken wire */
#define BATTERY_FULL_MV 25000u /* 5 V behind a divider by 5 */
#define CURRENT_FULL_MA 10000u /* 5 V behind a shunt amplifier of 0.5 V/A */

static const uint8_t channels[CHANNELS] = {0, 1, 2, 3, ADC_BATTERY, ADC_CURRENT};
static volatile uint16_t samples[CHANNELS];
static volatile uint8_t rounds; /* wraps */
static uint8_t at;
static uint8_t rounds_read;
static uint8_t stale_reads;

static void convert(uint8_t channel)
{
    ADMUX = (uint8_t)(_BV(REFS0) | channel);
    ADCSRA = (uint8_t)(ADCSRA | _BV(ADSC));
}

/* Keep the conversion that has ended and begin the next one. */
static void collect(void)
{
    samples[at] = ADC;
    at++;
    if (at == CHANNELS) {
        at = 0;
        rounds++;
    }
    convert(channels[at]);
}

ISR(ADC_vect)
{
    collect();
}

/* Takes every channel once, so that nothing starts from a sample that was never taken. */
void analog_start(void)
{
    ADCSRA = (uint8_t)(_BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0)); /* 125 kHz */
    convert(channels[0]);
    for (uint8_t taken = 0; taken < CHANNELS;) {
        if ((ADCSRA & _BV(ADSC)) == 0) {
            collect();
            taken++;
        }
    }
    ADCSRA = (uint8_t)(ADCSRA | _BV(ADIE));
}

static uint16_t sample(uint8_t which)
{
    uint16_t value;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        value = samples[which];
    }
    return value;
}

bool analog_alive(void)
{
    uint8_t now = rounds;
    if (now != rounds_read) {
        rounds_read = now;
        stale_reads = 0;
    } else if (stale_reads < STALE_READS) {
        stale_reads++;
    } else {
        /* it stays dead until a round is made */
    }
    return stale_reads < STALE_READS;
}

uint8_t analog_cliffs(void)
{
    uint8_t bits = 0;
    for (uint8_t i = 0; i < ADC_CLIFFS; i++) {
        if (sample(i) > CLIFF_ABOVE) {
            bits = (uint8_t)(bits | (WIRE_CONTACT_BIT_CLIFF_LEFT << i));
        }
    }
    return bits;
}

uint16_t analog_battery_mv(void)
{
    return (uint16_t)(((uint32_t)sample(4) * BATTERY_FULL_MV) / 1024u);
}

int16_t analog_current_ma(void)
{
    return (int16_t)(((uint32_t)sample(5) * CURRENT_FULL_MA) / 1024u);
}
