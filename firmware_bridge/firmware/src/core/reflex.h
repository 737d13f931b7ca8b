/* Reflexes: reasons to stop that need nobody's opinion. Pure. */
#ifndef CORE_REFLEX_H
#define CORE_REFLEX_H

#include <stdbool.h>
#include <stdint.h>

#include "core/board_types.h"
#include "core/wheel.h"

#define BUMP_BITS (WIRE_CONTACT_BIT_BUMP_LEFT | WIRE_CONTACT_BIT_BUMP_RIGHT)
#define CLIFF_BITS                                                                          \
    (WIRE_CONTACT_BIT_CLIFF_LEFT | WIRE_CONTACT_BIT_CLIFF_FRONT_LEFT |                      \
     WIRE_CONTACT_BIT_CLIFF_FRONT_RIGHT | WIRE_CONTACT_BIT_CLIFF_RIGHT)

struct reflexes {
    uint32_t stalled_us[2]; /* for how long each condition has lasted */
    uint32_t over_current_us;
    uint32_t low_battery_us;
};

/* The reason to stop now (WIRE_STOP_REASON_*), after `dt_us` with these inputs and wheels. */
uint8_t reflexes_check(struct reflexes *r, const struct inputs *in, const struct wheel *left,
                       const struct wheel *right, uint32_t dt_us);

/* Does this reason persist, so that a stop must not be cleared? A pressed bumper and a cliff do
 * not: the way out is backwards, which stays allowed. */
bool reflexes_block_clear(const struct inputs *in);

#endif
