/* Wheel drivers with one direction and one PWM pin each (brake at PWM 0); brush and fan switches. */
#include <avr/io.h>

#include "board/atmega328p/parts.h"
#include "board/atmega328p/pins.h"
#include "board/hal.h"

#define WHEEL_TOP 400 /* 16 MHz / (2 * 400) = 20 kHz, and 400 = 1000 permille * 2 / 5 */

/* Phase-correct PWM: a compare value of 0 is a pin that stays low. */
void motors_start(void)
{
    ICR1 = WHEEL_TOP;
    TCCR1A = (uint8_t)(_BV(COM1A1) | _BV(COM1B1) | _BV(WGM11));
    TCCR1B = (uint8_t)(_BV(WGM13) | _BV(CS10));
    TCCR0A = (uint8_t)(_BV(COM0A1) | _BV(COM0B1) | _BV(WGM00));
    TCCR0B = (uint8_t)_BV(CS00); /* 31 kHz */
    DDRB = (uint8_t)(DDRB | _BV(LEFT_DIR) | _BV(LEFT_PWM) | _BV(RIGHT_PWM) | _BV(RIGHT_DIR));
    DDRD = (uint8_t)(DDRD | _BV(FAN_PWM) | _BV(BRUSH_PWM));
}

static uint16_t direct(int16_t pwm, uint8_t pin)
{
    if (pwm < 0) {
        PORTB = (uint8_t)(PORTB | _BV(pin));
        return (uint16_t)((-pwm * 2) / 5);
    }
    PORTB = (uint8_t)(PORTB & (uint8_t)~_BV(pin));
    return (uint16_t)((pwm * 2) / 5);
}

static uint8_t duty(uint8_t percent)
{
    return (uint8_t)(((uint16_t)percent * 255u) / 100u);
}

void hal_write(const struct outputs *out)
{
    OCR1A = direct(out->left_pwm, LEFT_DIR);
    OCR1B = direct(out->right_pwm, RIGHT_DIR);
    OCR0A = duty(out->brush_pct);
    OCR0B = duty(out->fan_pct);
}
