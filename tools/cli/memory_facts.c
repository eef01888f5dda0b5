#include "cli/memory_facts.h"

#include <inttypes.h>

#include "cli/words.h"

static void print_parts(FILE *out, const ebpo_model_plan *p)
{
    char top[40], chunks[40], skeletons[40], subtree[40];
    fprintf(out,
            "          levels 0 to %d stay in memory and take %s; the %" PRIu64
            " subtrees below them take %s each on average\n",
            p->cut_level, words_bytes(top, sizeof top, p->top), p->subtrees,
            words_bytes(subtree, sizeof subtree, p->subtree_bytes));
    if (p->subtrees_held < p->subtrees)
        fprintf(out,
                "          at most %" PRIu64 " of these subtrees are in memory at a time; chunks "
                "take up to %s, skeletons (bounds of subtrees that are not in memory) up to %s\n",
                p->subtrees_held, words_bytes(chunks, sizeof chunks, p->chunks),
                words_bytes(skeletons, sizeof skeletons, p->skeletons));
}

void memory_facts(FILE *out, const ebpo_model_plan *p)
{
    char budget[40], whole[40], least[40];
    fprintf(out, "\nmemory    %s: %s in memory\n",
            p->budget ? words_bytes(budget, sizeof budget, p->budget) : "no budget",
            p->resident ? "everything" : "not everything");
    if (!p->resident)
        print_parts(out, p);
    fprintf(out, "          the whole model takes up to %s; the least budget is about %s\n",
            words_bytes(whole, sizeof whole, p->whole), words_bytes(least, sizeof least, p->least));
}

void memory_facts_json(json *j, const char *key, const ebpo_model_plan *p)
{
    json_object(j, key);
    json_uint(j, "budget", p->budget);
    json_bool(j, "resident", p->resident);
    json_int(j, "cut_level", p->cut_level);
    json_uint(j, "whole", p->whole);
    json_uint(j, "least", p->least);
    json_uint(j, "top", p->top);
    json_uint(j, "chunks", p->chunks);
    json_uint(j, "skeletons", p->skeletons);
    json_uint(j, "subtrees", p->subtrees);
    json_uint(j, "subtree_bytes", p->subtree_bytes);
    json_uint(j, "subtrees_held", p->subtrees_held);
    json_end(j);
}
