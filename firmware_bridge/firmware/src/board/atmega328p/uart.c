/* USART0 at 115200 baud (16 MHz, double speed, +2.1 %): received bytes wait in a ring, bytes to send
 * are fetched as fast as the line takes them. */
#include <avr/interrupt.h>
#include <avr/io.h>

#include "board/atmega328p/parts.h"
#include "board/hal.h"

#define RING 128u /* 11 ms of a full line */

static volatile uint8_t ring[RING];
static volatile uint8_t head;
static volatile uint8_t tail;

void uart_start(void)
{
    UCSR0A = (uint8_t)_BV(U2X0);
    UBRR0 = 16;
    UCSR0C = (uint8_t)(_BV(UCSZ01) | _BV(UCSZ00));
    UCSR0B = (uint8_t)(_BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0));
}

/* A byte for which there is no room is lost, and the CRC of its frame with it. */
ISR(USART_RX_vect)
{
    uint8_t byte = UDR0;
    uint8_t next = (uint8_t)((head + 1u) % RING);
    if (next != tail) {
        ring[head] = byte;
        head = next;
    }
}

bool hal_receive(uint8_t *byte)
{
    if (tail == head) {
        return false;
    }
    *byte = ring[tail];
    tail = (uint8_t)((tail + 1u) % RING);
    return true;
}

/* The data register is empty. */
ISR(USART_UDRE_vect)
{
    uint8_t byte;
    if (line_next_byte(&byte)) {
        UDR0 = byte;
    } else {
        UCSR0B = (uint8_t)(UCSR0B & (uint8_t)~_BV(UDRIE0));
    }
}

/* Should the interrupt above come between reading and writing here, it only comes once more. */
void hal_wake_line(void)
{
    UCSR0B = (uint8_t)(UCSR0B | _BV(UDRIE0));
}
