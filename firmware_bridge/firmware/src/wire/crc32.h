/* CRC-32 as zlib computes it (reflected 0xEDB88320), by nibbles: 64 bytes of table. */
#ifndef WIRE_CRC32_H
#define WIRE_CRC32_H

#include <stdint.h>

uint32_t crc32(const uint8_t *data, uint8_t length);

#endif
