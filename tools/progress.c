#include "progress.h"

#include <stdio.h>
#include <time.h>
#include <unistd.h>

#include "words.h"

double progress_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void draw(progress_line *line, double now, uint64_t done, uint64_t total)
{
    char count[32], rate[32];
    double passed = now - line->begun, speed = passed > 0 ? (double)done / passed : 0;
    words_count(count, sizeof count, (double)done);
    words_count(rate, sizeof rate, speed);
    fprintf(stderr, "\r\033[K%s: %s", line->command, line->stage);
    if (total) {
        double share = done < total ? (double)done / (double)total : 1;
        fprintf(stderr, " %3.0f %%", 100 * share);
    } else if (done) {
        fprintf(stderr, " %s", count);
    }
    if (passed > 1 && done)
        fprintf(stderr, ", %s/s", rate);
    if (passed > 1 && total && done && done < total)
        fprintf(stderr, ", %.0f s left", (double)(total - done) / speed);
    fflush(stderr);
    line->shown = true;
}

static bool report(void *user, const char *stage, uint64_t done, uint64_t total)
{
    progress_line *line = user;
    double now = progress_now();
    if (stage != line->stage) {
        line->stage = stage;
        line->begun = now;
        line->last = 0;
    }
    if (now - line->last > 0.1) {
        line->last = now;
        draw(line, now, done, total);
    }
    return true;
}

ebpo_progress progress_start(progress_line *line, const char *command, bool quiet)
{
    *line = (progress_line){ .command = command, .active = !quiet && isatty(STDERR_FILENO) };
    return line->active ? (ebpo_progress){ report, line } : (ebpo_progress){ NULL, NULL };
}

void progress_wipe(progress_line *line)
{
    if (line->shown)
        fputs("\r\033[K", stderr);
    line->shown = false;
}
