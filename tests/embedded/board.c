/* What a program needs on QEMU's MPS2 boards (mps2-an386: Cortex-M4F, mps2-an500: Cortex-M7): vectors, and the unit that computes. */
#include <stdint.h>

extern char __stack[];
void _start(void);

static void reset(void) {
    *(volatile uint32_t *)0xe000ed88 |= 0xf << 20; /* CPACR: floating point */
    __asm volatile("dsb\nisb");
    _start();
}

static void stop(void) {
    for (;;) __asm volatile("bkpt 1");
}

__attribute__((section(".vectors"), used)) static void *const vectors[16] = {__stack, (void *)reset, (void *)stop, (void *)stop,
                                                                          (void *)stop, (void *)stop, (void *)stop};
