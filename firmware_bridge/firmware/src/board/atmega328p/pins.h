/* Arduino Nano/Uno pins. The wiring is in firmware/WIRING.md.
 * Switches are normally closed to ground with a pull-up: a broken wire reads as pressed. */
#ifndef BOARD_PINS_H
#define BOARD_PINS_H

#include <avr/io.h>

/* Port D */
#define LEFT_A PD2
#define LEFT_B PD3
#define RIGHT_A PD4
#define FAN_PWM PD5   /* OC0B */
#define BRUSH_PWM PD6 /* OC0A */
#define RIGHT_B PD7

/* Port B */
#define LEFT_DIR PB0
#define LEFT_PWM PB1  /* OC1A */
#define RIGHT_PWM PB2 /* OC1B */
#define BUMP_LEFT PB3
#define RIGHT_DIR PB4
#define CHARGING PB5 /* shares the board's LED, which then shows charging */

/* Port C, digital */
#define WHEEL_DROP PC4
#define BUMP_RIGHT PC5

/* ADC channels */
#define ADC_CLIFFS 4u /* channels 0 to 3: left, front left, front right, right */
#define ADC_BATTERY 6u
#define ADC_CURRENT 7u

#endif
