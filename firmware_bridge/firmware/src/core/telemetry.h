/* What the controller says: answers at once, telemetry by its timers while a session is open. */
#ifndef CORE_TELEMETRY_H
#define CORE_TELEMETRY_H

#include "core/controller.h"

void telemetry_hello_ack(struct controller *c, uint8_t seq, uint16_t session, uint32_t now_us);
void telemetry_ack(struct controller *c, uint8_t order, uint8_t result, uint32_t now_us);
void telemetry_send(struct controller *c, uint32_t now_us);

#endif
