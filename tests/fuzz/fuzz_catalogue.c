/* Fuzz target: any bytes as a catalogue file. A resulting catalogue must be valid: entries with
 * paths and boxes, from which another catalogue can be made. No model is opened. */
#include "fuzz_support.h"

#include <math.h>
#include <stdio.h>
#include <unistd.h>

#include <ebpo/catalogue.h>

/* Uses one file, which is written again for each input. */
static const char *written(const uint8_t *data, size_t size)
{
    static char path[64];
    static FILE *file;
    if (!file) {
        fuzz_must((file = tmpfile()) != NULL);
        snprintf(path, sizeof path, "/proc/self/fd/%d", fileno(file));
    }
    fuzz_must(ftruncate(fileno(file), 0) == 0);
    fuzz_must(pwrite(fileno(file), data, size, 0) == (ssize_t)size);
    return path;
}

static void check_entry(const ebpo_catalogue_entry *e)
{
    fuzz_must(e && e->path && e->path[0]);
    fuzz_must(!e->surface || (e->surface[0] && !e->only_caps));
    fuzz_must(!e->numbers || e->numbers[0]);
    fuzz_must((unsigned)e->rule <= EBPO_RULE_POSITIVE);
    for (int k = 0; k < 3; k++)
        fuzz_must(isfinite(e->min[k]) && isfinite(e->max[k]) && e->min[k] <= e->max[k]);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_catalogue *c, *again;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_catalogue_facts facts = EBPO_CATALOGUE_FACTS_INIT;
    ebpo_status status = ebpo_catalogue_open(written(data, size), NULL, &c, &error);
    fuzz_must((status == EBPO_OK) == (c != NULL));
    fuzz_must(status == EBPO_OK || (error.status == status && error.message[0]));
    if (!c)
        return 0;
    fuzz_must(ebpo_catalogue_get_facts(c, &facts) == EBPO_OK && facts.count > 0);
    fuzz_must(facts.file_bytes == size);
    for (uint64_t i = 0; i < facts.count; i++)
        check_entry(ebpo_catalogue_get_entry(c, i));
    fuzz_must(!ebpo_catalogue_get_entry(c, facts.count));
    fuzz_must(ebpo_catalogue_new(ebpo_catalogue_get_entry(c, 0), facts.count, NULL, &again,
                                 &error) == EBPO_OK);
    ebpo_catalogue_free(again);
    ebpo_catalogue_free(c);
    return 0;
}
