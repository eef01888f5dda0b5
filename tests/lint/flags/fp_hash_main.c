/* Prints a line for each small degenerate case: hash of the content, hash of the results, name.
 * Built once for each set of compiler flags, with the library's numeric sources built the same way.
 */
#include <fenv.h>
#include <inttypes.h>
#include <stdio.h>

#include "fp_hash.h"

int main(void)
{
    const fp_setting standard = { FE_TONEAREST, 0 };
    for (int i = 0; i < degenerate_case_count; i++) {
        fp_hashes h;
        if (!fp_hash_takes(&degenerate_cases[i]))
            continue;
        fp_hash_case(&degenerate_cases[i], &standard, 100, &h);
        printf("%016" PRIx64 " %016" PRIx64 " %s\n", h.content, h.results,
               degenerate_cases[i].name);
    }
    return 0;
}
