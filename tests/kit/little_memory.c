/* Preloaded: the machine has only so many bytes of memory left as the environment says. */
#include <stdint.h>
#include <stdlib.h>

uint64_t ebpo_free_memory(void);

__attribute__((visibility("default"))) uint64_t ebpo_free_memory(void)
{
    const char *bytes = getenv("EBPO_TEST_FREE");
    return bytes ? strtoull(bytes, NULL, 10) : UINT64_C(1) << 40;
}
