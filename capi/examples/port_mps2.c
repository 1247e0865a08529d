/* The example's machine is Arm's MPS2 board under QEMU, without a C library: start-up, and output by semihosting. */
#include <stdint.h>

#include "port.h"

extern uint32_t stack_top, bss_start, bss_end;
int main(void);

/* Operations of semihosting: SYS_WRITE0, and SYS_EXIT with the reason ADP_Stopped_ApplicationExit or another. */
#define SYS_WRITE0 0x04
#define SYS_EXIT 0x18
#define EXIT_GOOD 0x20026
#define EXIT_BAD 0x20023

static void semihost(uint32_t operation, uint32_t parameter)
{
    register uint32_t r0 __asm__("r0") = operation;
    register uint32_t r1 __asm__("r1") = parameter;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

void port_print(const char *text)
{
    semihost(SYS_WRITE0, (uint32_t)(uintptr_t)text);
}

static void reset(void)
{
    /* Both coprocessors of the floating-point unit on: CPACR. */
    *(volatile uint32_t *)0xe000ed88 |= 0xfu << 20;
    __asm__ volatile("dsb\n isb");
    for (uint32_t *word = &bss_start; word < &bss_end; word++)
        *word = 0;
    semihost(SYS_EXIT, main() == 0 ? EXIT_GOOD : EXIT_BAD);
    for (;;)
        ;
}

static void fault(void)
{
    semihost(SYS_EXIT, EXIT_BAD);
    for (;;)
        ;
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    &stack_top, (void *)reset, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault,
};
