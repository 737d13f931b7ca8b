/* What a board on this computer is driven through: records on stdin and stdout, little-endian and
 * packed, and a pseudo-terminal in the place of the UART. The emulated board uses it, too. */
#ifndef BOARD_HOST_LINE_H
#define BOARD_HOST_LINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define STEP_IN 25u /* bytes of a record; their fields stand in main.c */
#define STEP_OUT 14u
#define PORT_NAME 64u

uint64_t little(const uint8_t *bytes, unsigned size);
void put(uint8_t *bytes, uint64_t value, unsigned size);

/* Whole records from stdin and to stdout; false when the other end has gone. */
bool read_all(uint8_t *bytes, size_t size);
bool write_all(const uint8_t *bytes, size_t size);

/* Open a raw terminal pair, non-blocking; its path goes to `name` (PORT_NAME zeros before). The
 * slave stays open here too, so that the line outlives its users. -1 where there is none. */
int line_open(char *name);

/* Wait for bytes that were promised; false when they do not come within 5 s. */
bool line_wait(int line);

#endif
