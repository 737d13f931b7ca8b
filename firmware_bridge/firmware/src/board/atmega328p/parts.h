/* The parts of this board's hal, one file each. */
#ifndef BOARD_PARTS_H
#define BOARD_PARTS_H

#include <stdbool.h>
#include <stdint.h>

void uart_start(void);

void encoders_start(void);
void encoders_read(int32_t *left, int32_t *right);

void analog_start(void);
bool analog_alive(void);     /* whether samples are still taken; once a read */
uint8_t analog_cliffs(void); /* WIRE_CONTACT_BIT_CLIFF_* */
uint16_t analog_battery_mv(void);
int16_t analog_current_ma(void);

void motors_start(void);

#endif
