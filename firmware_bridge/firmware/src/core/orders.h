/* Orders: from a valid frame to what the controller does about it, with an answer to each. */
#ifndef CORE_ORDERS_H
#define CORE_ORDERS_H

#include "core/controller.h"

/* `body` is a frame body of at least WIRE_HEADER_SIZE bytes whose CRC was right. */
void orders_take(struct controller *c, const uint8_t *body, uint8_t length, uint32_t now_us);

#endif
