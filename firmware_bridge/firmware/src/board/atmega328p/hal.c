/* ATmega328P at 16 MHz: clock, switches, watchdog, start. */
#include "board/hal.h"

#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/atomic.h>

#include "board/atmega328p/parts.h"
#include "board/atmega328p/pins.h"
#include "wire/messages.h"

#define SAMPLES 7u /* three equal samples, a millisecond apart, make a switch */

enum { SWITCH_BUMP_LEFT, SWITCH_BUMP_RIGHT, SWITCH_DROP, SWITCH_CHARGING, SWITCHES };

static volatile uint32_t clock_ms;
static uint8_t history[SWITCHES];
static bool pressed[SWITCHES];

ISR(TIMER2_COMPA_vect)
{
    clock_ms++;
}

static void clock_start(void)
{
    OCR2A = 249; /* 16 MHz / 64 / 250 = 1 kHz; one count is 4 us */
    TCCR2A = (uint8_t)_BV(WGM21);
    TCCR2B = (uint8_t)_BV(CS22);
    TIMSK2 = (uint8_t)_BV(OCIE2A);
}

uint32_t hal_now_us(void)
{
    uint32_t ms;
    uint8_t count;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        ms = clock_ms;
        count = TCNT2;
        if ((TIFR2 & _BV(OCF2A)) != 0) {
            count = TCNT2; /* the timer has turned over, its interrupt waits */
            ms++;
        }
    }
    return (ms * 1000u) + ((uint32_t)count * 4u);
}

/* Before anything else: after a watchdog reset it runs on with its shortest time. */
static void watchdog_off(void) __attribute__((naked, used, section(".init3")));
static void watchdog_off(void)
{
    MCUSR = 0;
    wdt_disable();
}

static uint16_t count_start(void)
{
    static uint16_t *const cell = (uint16_t *)2;
    uint16_t boot = (uint16_t)(eeprom_read_word(cell) + 1u);
    eeprom_update_word(cell, boot);
    return boot;
}

uint16_t hal_start(void)
{
    uint16_t boot = count_start();
    PORTB = (uint8_t)_BV(BUMP_LEFT);
    PORTC = (uint8_t)(_BV(WHEEL_DROP) | _BV(BUMP_RIGHT));
    motors_start();
    analog_start();
    encoders_start();
    uart_start();
    clock_start();
    wdt_enable(WDTO_60MS);
    sei();
    return boot;
}

static bool is_set(uint8_t port, uint8_t pin)
{
    return (port & _BV(pin)) != 0;
}

static void debounce(uint8_t which, bool now)
{
    history[which] = (uint8_t)(((unsigned)history[which] << 1) | (now ? 1u : 0u));
    if ((history[which] & SAMPLES) == SAMPLES) {
        pressed[which] = true;
    } else if ((history[which] & SAMPLES) == 0u) {
        pressed[which] = false;
    } else {
        /* bouncing: it stays what it was */
    }
}

static uint8_t switches(void)
{
    uint8_t bits = 0;
    debounce(SWITCH_BUMP_LEFT, is_set(PINB, BUMP_LEFT));
    debounce(SWITCH_BUMP_RIGHT, is_set(PINC, BUMP_RIGHT));
    debounce(SWITCH_DROP, is_set(PINC, WHEEL_DROP));
    debounce(SWITCH_CHARGING, is_set(PINB, CHARGING));
    bits = (uint8_t)(bits | (pressed[SWITCH_BUMP_LEFT] ? WIRE_CONTACT_BIT_BUMP_LEFT : 0u));
    bits = (uint8_t)(bits | (pressed[SWITCH_BUMP_RIGHT] ? WIRE_CONTACT_BIT_BUMP_RIGHT : 0u));
    bits = (uint8_t)(bits | (pressed[SWITCH_DROP] ? WIRE_CONTACT_BIT_WHEEL_DROP : 0u));
    return (uint8_t)(bits | (pressed[SWITCH_CHARGING] ? WIRE_CONTACT_BIT_CHARGING : 0u));
}

void hal_read(struct inputs *in)
{
    encoders_read(&in->left_ticks, &in->right_ticks);
    in->contacts = (uint8_t)(switches() | analog_cliffs());
    in->battery_mv = analog_battery_mv();
    in->current_ma = analog_current_ma();
    if (!analog_alive()) { /* old samples are none: cliffs all around and no battery */
        in->contacts = (uint8_t)(in->contacts | WIRE_CONTACT_BIT_CLIFF_LEFT |
                                 WIRE_CONTACT_BIT_CLIFF_FRONT_LEFT |
                                 WIRE_CONTACT_BIT_CLIFF_FRONT_RIGHT | WIRE_CONTACT_BIT_CLIFF_RIGHT);
        in->battery_mv = 0;
    }
}

void hal_idle(void)
{
    SMCR = (uint8_t)_BV(SE); /* idle: only the processor stops */
    sleep_cpu();
}

void hal_feed_watchdog(void)
{
    wdt_reset();
}
