#define _XOPEN_SOURCE 600

#include "board/host/line.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <termios.h>
#include <unistd.h>

#define DELIVERY_MS 5000

uint64_t little(const uint8_t *bytes, unsigned size)
{
    uint64_t value = 0;
    for (unsigned i = size; i > 0u; i--) {
        value = (value << 8) | bytes[i - 1u];
    }
    return value;
}

void put(uint8_t *bytes, uint64_t value, unsigned size)
{
    for (unsigned i = 0; i < size; i++) {
        bytes[i] = (uint8_t)(value >> (8u * i));
    }
}

bool read_all(uint8_t *bytes, size_t size)
{
    while (size > 0u) {
        ssize_t got = read(STDIN_FILENO, bytes, size);
        if ((got < 0) && (errno == EINTR)) {
            continue;
        }
        if (got <= 0) {
            return false;
        }
        bytes += got;
        size -= (size_t)got;
    }
    return true;
}

bool write_all(const uint8_t *bytes, size_t size)
{
    while (size > 0u) {
        ssize_t put_out = write(STDOUT_FILENO, bytes, size);
        if ((put_out < 0) && (errno == EINTR)) {
            continue;
        }
        if (put_out <= 0) {
            return false;
        }
        bytes += put_out;
        size -= (size_t)put_out;
    }
    return true;
}

int line_open(char *name)
{
    struct termios raw;
    int line = posix_openpt(O_RDWR | O_NOCTTY);
    if ((line < 0) || (grantpt(line) != 0) || (unlockpt(line) != 0)) {
        return -1;
    }
    const char *slave = ptsname(line);
    int kept = (slave != NULL) ? open(slave, O_RDWR | O_NOCTTY) : -1;
    if ((kept < 0) || (strlen(slave) >= PORT_NAME) || (tcgetattr(kept, &raw) != 0)) {
        return -1;
    }
    raw.c_iflag = 0;
    raw.c_oflag = 0;
    raw.c_lflag = 0;
    raw.c_cflag = CS8 | CREAD | CLOCAL;
    if ((tcsetattr(kept, TCSANOW, &raw) != 0) ||
        (fcntl(line, F_SETFL, fcntl(line, F_GETFL) | O_NONBLOCK) != 0)) {
        return -1;
    }
    memcpy(name, slave, strlen(slave));
    return line;
}

bool line_wait(int line)
{
    struct pollfd waiting = {.fd = line, .events = POLLIN};
    int ready = poll(&waiting, 1, DELIVERY_MS);
    return (ready > 0) || ((ready < 0) && (errno == EINTR));
}
