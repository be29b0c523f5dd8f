/* A bare Cortex-M4F: vector table, floating-point unit, one run over a log, voltages out by semihosting. */
#include "controller.h"
#include "log.h"

#include <stdint.h>

extern uint32_t data_start, data_end, data_load, bss_start, bss_end, stack_low, stack_top;

void reset(void);
void fault(void);
real_t one_step(controller_state *state, real_t r, real_t x);

/* The first words of flash: stack pointer, reset, and the faults. */
__attribute__((section(".vectors"), used)) static const void *const vectors[] = {
    &stack_top, (const void *)reset, (const void *)fault, (const void *)fault,
    (const void *)fault, (const void *)fault, (const void *)fault};

static controller_state state;

static int call_host(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;

    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void print_hex(uint64_t value, int digits)
{
    char text[18];

    for (int i = digits - 1; i >= 0; --i) {
        text[i] = "0123456789abcdef"[value & 15U];
        value >>= 4;
    }
    text[digits] = '\n';
    text[digits + 1] = '\0';
    call_host(0x04, text);
}

static void stop(uint32_t reason)
{
    call_host(0x18, (const void *)reason);
    for (;;) {
    }
}

void fault(void)
{
    call_host(0x04, "fault\n");
    stop(0x20023);
}

/* Called, not inlined: what is counted begins and ends here. */
__attribute__((noipa)) real_t one_step(controller_state *s, real_t r, real_t x)
{
    return controller_step(s, r, x);
}

void reset(void)
{
    volatile uint32_t *cpacr = (volatile uint32_t *)0xE000ED88U;

    *cpacr |= 0xFU << 20;
    __asm__ volatile("dsb\n isb");
    for (uint32_t *from = &data_load, *to = &data_start; to < &data_end; ++from, ++to) {
        *to = *from;
    }
    for (uint32_t *to = &bss_start; to < &bss_end; ++to) {
        *to = 0;
    }
    for (volatile uint32_t *at = &stack_low; at < &stack_top - 64; ++at) {
        *at = 0xC0FFEE00U;
    }
    controller_init(&state);
    for (int k = 0; k < LOG_SIZE; ++k) {
        union {
            real_t value;
            uint64_t wide;
            uint32_t narrow;
        } bits = {.wide = 0};

        bits.value = one_step(&state, log_r[k], log_x[k]);
        print_hex(sizeof(real_t) == 4 ? bits.narrow : bits.wide, 2 * (int)sizeof(real_t));
    }
    volatile uint32_t *at = &stack_low;
    while (at < &stack_top && *at == 0xC0FFEE00U) {
        ++at;
    }
    call_host(0x04, "stack ");
    print_hex((uint64_t)((uint32_t)&stack_top - (uint32_t)at), 8);
    stop(0x20026);
}
