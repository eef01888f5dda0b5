#include "cli/progress.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "cli/stage_rows.h"
#include "cli/tool_clock.h"
#include "cli/words.h"

double progress_now(void) { return 1e-9 * (double)tool_clock(); }

/* Draws the rate of the work. If line->faces is set, the unit is bytes per second while the mesh is
 * read, and then faces per second. Otherwise it is the unit of the progress reports per second.
 * `speed`: units of the reports per second. */
static void draw_rate(const progress_line *line, double speed, uint64_t total)
{
    char rate[32];
    uint64_t faces = line->faces ? *line->faces : 0;
    if (line->faces && !faces)
        fprintf(stderr, ", %s/s", words_bytes(rate, sizeof rate, (uint64_t)speed));
    else if (faces && total)
        fprintf(stderr, ", %s faces/s",
                words_count(rate, sizeof rate, speed / (double)total * (double)faces));
    else
        fprintf(stderr, ", %s/s", words_count(rate, sizeof rate, speed));
}

static void draw_line(progress_line *line, double now, uint64_t done, uint64_t total)
{
    char count[32];
    double passed = now - line->begun, speed = passed > 0 ? (double)done / passed : 0;
    words_count(count, sizeof count, (double)done);
    fprintf(stderr, "\r\033[K%s: ", line->command);
    if (line->plan)
        fprintf(stderr, "stage %d of %d, ", line->at + 1, line->plan_count);
    fprintf(stderr, "%s", line->stage);
    if (total) {
        double share = done < total ? (double)done / (double)total : 1;
        fprintf(stderr, " %3.0f %%", 100 * share);
    } else if (done) {
        fprintf(stderr, " %s", count);
    }
    if (passed > 1 && done)
        draw_rate(line, speed, total);
    if (passed > 1 && total && done && done < total)
        fprintf(stderr, ", %.0f s left", (double)(total - done) / speed);
    fflush(stderr);
    line->shown = true;
}

void progress_end_stage(progress_line *line)
{
    double now = progress_now();
    if (line->stage)
        line->stages[line->current].seconds += now - line->begun;
    line->begun = now;
}

/* Begins a stage. If the array `stages` is full, the time of a new stage is added to the last entry
 * of the array. */
static void begin_stage(progress_line *line, const char *stage)
{
    int i = 0;
    while (i < line->stage_count && strcmp(line->stages[i].name, stage) != 0)
        i++;
    if (i == line->stage_count && i < PROGRESS_STAGES)
        line->stages[line->stage_count++].name = stage;
    line->current = i < PROGRESS_STAGES ? i : PROGRESS_STAGES - 1;
    line->stage = stage;
    /* The search begins at the current stage, so that the shown number never decreases. */
    for (i = line->at; i < line->plan_count; i++)
        if (line->plan[i] == (int)stages_row(stage)) {
            line->at = i;
            break;
        }
    line->last = 0;
}

static bool report_progress(void *user, const char *stage, uint64_t done, uint64_t total)
{
    progress_line *line = user;
    double now = progress_now();
    if (!line->stage || (stage != line->stage && strcmp(stage, line->stage) != 0)) {
        progress_end_stage(line);
        begin_stage(line, stage);
    }
    if (line->active && now - line->last > 0.1) {
        line->last = now;
        draw_line(line, now, done, total);
    }
    return true;
}

ebpo_progress progress_start(progress_line *line, const char *command, bool quiet)
{
    *line = (progress_line){ .command = command, .active = !quiet && isatty(STDERR_FILENO) };
    return (ebpo_progress){ report_progress, line };
}

void progress_report(progress_line *line, const char *stage, uint64_t done, uint64_t total)
{
    (void)report_progress(line, stage, done, total);
}

void progress_plan(progress_line *line, const int *plan, int count, const uint64_t *faces)
{
    line->plan = plan;
    line->plan_count = count;
    line->faces = faces;
}

void progress_wipe(progress_line *line)
{
    if (line->shown)
        fputs("\r\033[K", stderr);
    line->shown = false;
}
