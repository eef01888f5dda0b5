/* Counts checks and violations of the verifier, and keeps the first violation of each kind.
 *
 * Each thread counts in a separate tally; later the tallies are merged. Violations are ordered by
 * octcode (locational code), then by face, then by plane, then by text. So the report does not
 * depend on which thread finds a violation, or on the order of merging. */
#include "verify/tally.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "geometry/cells.h"

static int compare_u64(uint64_t a, uint64_t b) { return (a > b) - (a < b); }

static int compare_places(const ebpo_verify_place *a, const ebpo_verify_place *b)
{
    int order = compare_u64(a->octcode, b->octcode);
    if (order == 0)
        order = compare_u64(a->face, b->face);
    return order != 0 ? order : compare_u64(a->plane, b->plane);
}

/* Prints a place as "level 5, octcode 0o1234567, face 17, plane 2: ". Omits items that the place
 * does not have. Returns the length. */
static int print_place(char *out, size_t size, const ebpo_verify_place *place)
{
    int length = 0;
    const char *comma = "";
    if (place->octcode) {
        length += snprintf(out, size, "level %d, octcode 0o%" PRIo64,
                           ebpo_octcode_level(place->octcode), place->octcode);
        comma = ", ";
    }
    if (place->face != EBPO_NO_FACE) {
        length +=
            snprintf(out + length, size - (size_t)length, "%sface %" PRIu64, comma, place->face);
        comma = ", ";
    }
    if (place->plane != EBPO_NO_PLANE)
        length +=
            snprintf(out + length, size - (size_t)length, "%splane %" PRIu32, comma, place->plane);
    if (length)
        length += snprintf(out + length, size - (size_t)length, ": ");
    return length;
}

/* Counts a violation. Keeps its text if it is the first violation of its kind so far. Violations at
 * the same place are ordered by their text, so that the result does not depend on the order of
 * merging. */
static void record_violation(ebpo_tally *tally, ebpo_verify_kind kind,
                             const ebpo_verify_place *place, const char *text)
{
    int order = tally->violations[kind] ? compare_places(place, &tally->place[kind]) : -1;
    tally->violations[kind]++;
    if (order < 0 || (order == 0 && strcmp(text, tally->first[kind]) < 0)) {
        tally->place[kind] = *place;
        snprintf(tally->first[kind], sizeof tally->first[kind], "%s", text);
    }
}

/* Prints the place and the text, and counts the violation. */
static void record_arguments(ebpo_tally *tally, ebpo_verify_kind kind,
                             const ebpo_verify_place *place, const char *format, va_list args)
{
    char text[sizeof tally->first[kind]];
    int length = print_place(text, sizeof text, place);
    vsnprintf(text + length, sizeof text - (size_t)length, format, args);
    record_violation(tally, kind, place, text);
}

void ebpo_tally_violation(ebpo_tally *tally, ebpo_verify_kind kind, const ebpo_verify_place *place,
                          const char *format, ...)
{
    if (tally->violations[kind] && compare_places(place, &tally->place[kind]) > 0) {
        /* a damaged file may have millions of violations, so a text is printed only if it may be
         * kept */
        tally->violations[kind]++;
        return;
    }
    va_list args;
    va_start(args, format);
    record_arguments(tally, kind, place, format, args);
    va_end(args);
}

bool ebpo_tally_check(ebpo_tally *tally, ebpo_verify_kind kind, bool holds, const char *format, ...)
{
    tally->checks[kind]++;
    if (holds)
        return true;
    va_list args;
    va_start(args, format);
    record_arguments(tally, kind, &(ebpo_verify_place){ 0, EBPO_NO_FACE, EBPO_NO_PLANE }, format,
                     args);
    va_end(args);
    return false;
}

void ebpo_tally_merge(ebpo_tally *into, const ebpo_tally *from)
{
    for (int kind = 0; kind < EBPO_VERIFY_KINDS; kind++) {
        into->checks[kind] += from->checks[kind];
        if (from->violations[kind]) {
            record_violation(into, (ebpo_verify_kind)kind, &from->place[kind], from->first[kind]);
            into->violations[kind] += from->violations[kind] - 1;
        }
    }
    into->spare_entries += from->spare_entries;
    into->exact_touches += from->exact_touches;
    into->exact_half_spaces += from->exact_half_spaces;
}

void ebpo_tally_report(const ebpo_tally *tally, ebpo_verify_report *report)
{
    ebpo_verify_count *count[EBPO_VERIFY_KINDS] = { &report->structure,   &report->content,
                                                    &report->containment, &report->nesting,
                                                    &report->labels,      &report->lists,
                                                    &report->source };
    for (int kind = 0; kind < EBPO_VERIFY_KINDS; kind++) {
        count[kind]->checks = tally->checks[kind];
        count[kind]->violations = tally->violations[kind];
        snprintf(count[kind]->first, sizeof count[kind]->first, "%s", tally->first[kind]);
        report->checks += tally->checks[kind];
        report->violations += tally->violations[kind];
    }
}
