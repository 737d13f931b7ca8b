/* The real ATmega328P image on an emulated board, in lock-step with a simulator. It speaks the very
 * records of src/board/host/main.c on stdin and stdout, with the UART on a pseudo-terminal; time is
 * the controller's own: 16 cycles are a microsecond, however long this computer needs for them.
 * Bytes take their time on the line, encoder edges are spread evenly over a step, and the pins and
 * ADC channels are those of src/board/atmega328p/pins.h.
 *
 * Four values of dt_us are orders of their own: HANG leads the program into an endless loop (as a
 * fault would), POWER_CYCLE resets the controller (its EEPROM stays), BLIND ends the interrupts of
 * the ADC, STACK answers in the place of bytes_sent how deep the stack has been.
 *
 * Usage: emulated-board IMAGE.elf [ADDRESS FILE]
 * With an address, FILE gets the cycle number of every pass of the program through it.
 */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

#include "board/host/line.h"

#define CYCLES_PER_US 16u
#define FREQUENCY 16000000u
#define BYTE_CYCLES 1389u /* ten bits at 115200 baud */
#define SLICE_CYCLES 800u /* 50 us: how finely pins and line follow */
#define EDGE_CYCLES 160u  /* 10 us: the least time between two edges */
#define HANG UINT32_MAX
#define POWER_CYCLE (UINT32_MAX - 1u)
#define BLIND (UINT32_MAX - 2u)
#define STACK (UINT32_MAX - 3u)
#define PAINT 0xA5u /* on RAM that nobody has written to */
#define RAM_START 0x100u

#define QUEUE 65536u

#define FULL_MV 5000
#define DDRB 0x24
#define PORTB 0x25
#define DDRD 0x2A
#define OCR0A 0x47
#define OCR0B 0x48
#define TCCR0B 0x45
#define TCCR1B 0x81
#define CLOCK_SELECT 7u
#define ADCSRA 0x7A
#define ADIE 3
#define OCR1A 0x88
#define OCR1B 0x8A
#define WHEEL_TOP 400

enum { LEFT_DIR = 0, LEFT_PWM = 1, RIGHT_PWM = 2, BUMP_LEFT = 3, RIGHT_DIR = 4, CHARGING = 5 };
enum { LEFT_A = 2, LEFT_B = 3, RIGHT_A = 4, FAN_PWM = 5, BRUSH_PWM = 6, RIGHT_B = 7 };
enum { WHEEL_DROP = 4, BUMP_RIGHT = 5 };

struct pins {
    int32_t left_ticks;
    int32_t right_ticks;
    uint16_t battery_mv;
    int16_t current_ma;
    uint8_t contacts;
};

static avr_t *avr;
static struct pins pins = {.battery_mv = 16000};
static int line;
static bool line_ready = true; /* the UART takes another byte */
static uint8_t inbox[QUEUE];   /* from the host, not yet on the line */
static uint32_t inbox_head, inbox_tail;
static uint8_t outbox[QUEUE]; /* from the UART, still on the line */
static avr_cycle_count_t outbox_due[QUEUE];
static uint32_t outbox_head, outbox_tail;
static uint64_t taken, given;
static uint32_t trace_address;
static FILE *trace;

static void quiet(avr_t *a, const int level, const char *format, va_list values)
{
    (void)a;
    if (level == LOG_ERROR) {
        vfprintf(stderr, format, values);
    }
}

/* While the program sleeps only its own time passes. */
static void sleep_on(avr_t *a, avr_cycle_count_t cycles)
{
    (void)a;
    (void)cycles;
}

/* ---------------------------------------------------------------- line */

static void on_output(avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)unused;
    outbox[outbox_head % QUEUE] = (uint8_t)value;
    outbox_due[outbox_head % QUEUE] = avr->cycle + BYTE_CYCLES;
    outbox_head++;
}

static void on_ready(avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)value;
    (void)unused;
    line_ready = true;
}

static void on_full(avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)value;
    (void)unused;
    line_ready = false;
}

static avr_irq_t *uart(int which)
{
    return avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), which);
}

static void connect_line(void)
{
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(uart(UART_IRQ_OUTPUT), on_output, NULL);
    avr_irq_register_notify(uart(UART_IRQ_OUT_XON), on_ready, NULL);
    avr_irq_register_notify(uart(UART_IRQ_OUT_XOFF), on_full, NULL);
}

/* Everything that the host has sent by now, however long the kernel takes to deliver it. */
static bool take_bytes(uint64_t sent)
{
    while (taken < sent) {
        uint8_t bytes[256];
        uint64_t left = sent - taken;
        ssize_t got = read(line, bytes, (left < sizeof bytes) ? (size_t)left : sizeof bytes);
        if (got > 0) {
            for (ssize_t i = 0; i < got; i++) {
                inbox[inbox_head++ % QUEUE] = bytes[i];
            }
            taken += (uint64_t)got;
        } else if (!line_wait(line)) {
            return false;
        } else {
            /* there is something now */
        }
    }
    return true;
}

static void move_bytes(void)
{
    while (line_ready && (inbox_tail != inbox_head)) {
        avr_raise_irq(uart(UART_IRQ_INPUT), inbox[inbox_tail++ % QUEUE]);
    }
    while ((outbox_tail != outbox_head) && (outbox_due[outbox_tail % QUEUE] <= avr->cycle)) {
        given += (write(line, &outbox[outbox_tail % QUEUE], 1) == 1) ? 1u : 0u;
        outbox_tail++;
    }
}

/* ---------------------------------------------------------------- pins */

/* The wires hold the inputs, whatever pull-ups the program switches on, and also when it writes to
 * other pins of the port. */
static void set_pin(unsigned port, int pin, bool high)
{
    static unsigned wired[3], levels[3];
    unsigned at = port - 'B';
    unsigned bit = 1u << pin;
    if (((wired[at] & bit) != 0u) && (((levels[at] & bit) != 0u) == high)) {
        return;
    }
    wired[at] |= bit;
    levels[at] = high ? (levels[at] | bit) : (levels[at] & ~bit);
    avr_ioport_external_t wires = {
        .name = port & 0x7Fu, .mask = wired[at] & 0xFFu, .value = levels[at] & 0xFFu};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(port), &wires);
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(port), pin), high ? 1u : 0u);
}

static void set_encoders(void)
{
    static const uint8_t gray[4] = {0, 1, 3, 2}; /* B A, forwards */
    uint8_t left = gray[(uint32_t)pins.left_ticks & 3u];
    uint8_t right = gray[(uint32_t)pins.right_ticks & 3u];
    set_pin('D', LEFT_A, (left & 1u) != 0u);
    set_pin('D', LEFT_B, (left & 2u) != 0u);
    set_pin('D', RIGHT_A, (right & 1u) != 0u);
    set_pin('D', RIGHT_B, (right & 2u) != 0u);
}

static void set_analog(int channel, int millivolts)
{
    int limited = (millivolts < 0) ? 0 : ((millivolts > FULL_MV) ? FULL_MV : millivolts);
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0 + channel),
                  (uint32_t)limited);
}

static void set_pins(void)
{
    set_pin('B', BUMP_LEFT, (pins.contacts & 1u) != 0u);
    set_pin('C', BUMP_RIGHT, (pins.contacts & 2u) != 0u);
    for (int i = 0; i < 4; i++) {
        set_analog(i, ((pins.contacts >> (2 + i)) & 1) ? 4500 : 500);
    }
    set_pin('C', WHEEL_DROP, (pins.contacts & 64u) != 0u);
    set_pin('B', CHARGING, (pins.contacts & 128u) != 0u);
    set_analog(6, pins.battery_mv / 5);
    set_analog(7, pins.current_ma / 2);
    set_encoders();
}

static int16_t wheel_pwm(int pwm_pin, int dir_pin, int compare)
{
    int value = avr->data[compare] | (avr->data[compare + 1] << 8);
    bool runs = (avr->data[TCCR1B] & CLOCK_SELECT) != 0u;
    if (!runs || ((avr->data[DDRB] & (1 << pwm_pin)) == 0)) {
        return 0; /* not driven: the driver's own pull-down brakes */
    }
    value = (value * 1000) / WHEEL_TOP;
    return (int16_t)((avr->data[PORTB] & (1 << dir_pin)) != 0 ? -value : value);
}

static uint8_t duty_pct(int pin, int compare)
{
    if (((avr->data[TCCR0B] & CLOCK_SELECT) == 0u) || ((avr->data[DDRD] & (1 << pin)) == 0)) {
        return 0;
    }
    return (uint8_t)((avr->data[compare] * 100 + 127) / 255);
}

/* ---------------------------------------------------------------- time */

static bool run_until(avr_cycle_count_t end)
{
    while (avr->cycle < end) {
        int state = avr_run(avr);
        if ((state == cpu_Done) || (state == cpu_Crashed)) {
            return false;
        }
        if ((trace != NULL) && (avr->pc == trace_address)) {
            fprintf(trace, "%llu\n", (unsigned long long)avr->cycle);
        }
    }
    return true;
}

static uint32_t part(int32_t whole, uint64_t done, uint64_t all)
{
    return (uint32_t)(((int64_t)whole * (int64_t)done) / (int64_t)all);
}

/* One edge nearer; false when there is none to go. */
static bool follow(int32_t *ticks, uint32_t wanted)
{
    int32_t behind = (int32_t)(wanted - (uint32_t)*ticks);
    *ticks = (int32_t)((uint32_t)*ticks + (uint32_t)((behind > 0) - (behind < 0)));
    return behind != 0;
}

/* Turn both encoders to these counts, edge by edge, so that none is jumped over. */
static bool turn_encoders(uint32_t left, uint32_t right)
{
    for (;;) {
        bool left_moved = follow(&pins.left_ticks, left);
        bool right_moved = follow(&pins.right_ticks, right);
        if (!left_moved && !right_moved) {
            return true;
        }
        set_encoders();
        if (!run_until(avr->cycle + EDGE_CYCLES)) {
            return false;
        }
    }
}

/* Let the program go on in the endless loop that stands behind every main. */
static bool hang(void)
{
    for (uint32_t at = 0; at < avr->flashend; at += 2u) {
        if ((avr->flash[at] == 0xFFu) && (avr->flash[at + 1u] == 0xCFu)) {
            avr->pc = at;
            return true;
        }
    }
    return false;
}

/* From the end of RAM down to the longest stretch that still has its paint. */
static uint32_t stack_used(void)
{
    uint32_t best = 0, end = RAM_START, run = 0;
    for (uint32_t at = RAM_START; at <= avr->ramend; at++) {
        run = (avr->data[at] == PAINT) ? run + 1u : 0u;
        if (run > best) {
            best = run;
            end = at + 1u;
        }
    }
    return (uint32_t)avr->ramend + 1u - end;
}

static bool step(const uint8_t *record)
{
    uint32_t dt_us = (uint32_t)little(&record[0], 4);
    int32_t left = pins.left_ticks, right = pins.right_ticks;
    int32_t left_moves = (int32_t)((uint32_t)little(&record[4], 4) - (uint32_t)left);
    int32_t right_moves = (int32_t)((uint32_t)little(&record[8], 4) - (uint32_t)right);
    if (dt_us == HANG) {
        return hang();
    }
    if (dt_us == POWER_CYCLE) {
        avr_reset(avr);
        return true;
    }
    if (dt_us == STACK) {
        return true;
    }
    if (dt_us == BLIND) {
        avr->data[ADCSRA] &= (uint8_t)~(1u << ADIE);
        return true;
    }
    pins.battery_mv = (uint16_t)little(&record[20], 2);
    pins.current_ma = (int16_t)(uint16_t)little(&record[22], 2);
    pins.contacts = record[24];
    if (!take_bytes(little(&record[12], 8))) {
        return false;
    }
    set_pins();
    static avr_cycle_count_t start;
    uint64_t all = (uint64_t)dt_us * CYCLES_PER_US;
    for (uint64_t done = 0; done < all;) {
        done = (all - done > SLICE_CYCLES) ? done + SLICE_CYCLES : all;
        move_bytes();
        if (!run_until(start + done)) {
            return false;
        }
        if (!turn_encoders((uint32_t)left + part(left_moves, done, all),
                           (uint32_t)right + part(right_moves, done, all))) {
            return false;
        }
    }
    start += all;
    move_bytes();
    return true;
}

static bool start(int argc, char **argv)
{
    static elf_firmware_t image;
    avr_global_logger_set(quiet);
    if ((argc < 2) || (elf_read_firmware(argv[1], &image) != 0)) {
        return false;
    }
    avr = avr_make_mcu_by_name("atmega328p");
    if ((avr == NULL) || (avr_init(avr) != 0)) {
        return false;
    }
    avr->frequency = FREQUENCY;
    avr->vcc = avr->avcc = avr->aref = FULL_MV;
    avr_load_firmware(avr, &image);
    memset(&avr->data[RAM_START], PAINT, (size_t)avr->ramend + 1u - RAM_START);
    avr->sleep = sleep_on;
    if (argc > 3) {
        trace_address = (uint32_t)strtoul(argv[2], NULL, 0);
        trace = fopen(argv[3], "w");
    }
    for (uint8_t i = 0; i < 2u; i++) { /* encoder pins are no external interrupts: no polling */
        avr_extint_set_strict_lvl_trig(avr, i, 0);
    }
    connect_line();
    set_pins();
    return true;
}

int main(int argc, char **argv)
{
    uint8_t record[STEP_IN];
    uint8_t answer[STEP_OUT];
    char name[PORT_NAME] = {0};
    line = line_open(name);
    if ((line < 0) || !start(argc, argv) || !write_all((const uint8_t *)name, sizeof name)) {
        return EXIT_FAILURE;
    }
    while (read_all(record, sizeof record)) {
        if (!step(record)) {
            return EXIT_FAILURE;
        }
        put(&answer[0], (uint16_t)wheel_pwm(LEFT_PWM, LEFT_DIR, OCR1A), 2);
        put(&answer[2], (uint16_t)wheel_pwm(RIGHT_PWM, RIGHT_DIR, OCR1B), 2);
        answer[4] = duty_pct(BRUSH_PWM, OCR0A);
        answer[5] = duty_pct(FAN_PWM, OCR0B);
        put(&answer[6], (little(record, 4) == STACK) ? stack_used() : given, 8);
        if (!write_all(answer, sizeof answer)) {
            return EXIT_FAILURE;
        }
    }
    if (trace != NULL) {
        fclose(trace);
    }
    return EXIT_SUCCESS;
}
