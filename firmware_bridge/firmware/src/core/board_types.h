/* What a board hands to the core and takes from it. */
#ifndef CORE_BOARD_TYPES_H
#define CORE_BOARD_TYPES_H

#include <stdint.h>

struct inputs {
    int32_t left_ticks; /* cumulative, wrap */
    int32_t right_ticks;
    uint8_t contacts; /* WIRE_CONTACT_BIT_* */
    uint16_t battery_mv;
    int16_t current_ma;
};

struct outputs {
    int16_t left_pwm; /* -1000 to 1000 permille, forward positive; 0 brakes */
    int16_t right_pwm;
    uint8_t brush_pct; /* 0 to 100 */
    uint8_t fan_pct;
};

#endif
