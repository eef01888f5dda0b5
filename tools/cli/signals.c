#include "cli/signals.h"

#include <ebpo/base.h>
#include <signal.h>
#include <string.h>

static void (*volatile also)(void);
static void (*volatile scratch)(void);

void signals_also(void (*clean_up)(void)) { also = clean_up; }

void signals_scratch(void (*clean_up)(void)) { scratch = clean_up; }

static void give_up(int number)
{
    ebpo_abandon_outputs();
    if (also)
        also();
    if (scratch)
        scratch();
    /* SA_RESETHAND restored the default action, so that the parent process sees the signal. It is
     * raised before this handler returns, as another thread may be about to open the output again
     * by its name. */
    sigset_t only;
    sigemptyset(&only);
    sigaddset(&only, number);
    pthread_sigmask(SIG_UNBLOCK, &only, NULL);
    ebpo_abandon_outputs();
    raise(number);
}

void signals_install(void)
{
    /* A limit on file size is an error like a full disk. */
    signal(SIGXFSZ, SIG_IGN);
    /* SIGPIPE: the reader of the output has read enough, as head does. */
    static const int numbers[] = { SIGINT, SIGTERM, SIGHUP, SIGPIPE };
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        struct sigaction action, before;
        memset(&action, 0, sizeof action);
        action.sa_handler = give_up;
        action.sa_flags = (int)SA_RESETHAND;
        sigfillset(&action.sa_mask);
        /* Signals that the parent process ignores (nohup) stay ignored. */
        if (sigaction(numbers[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN)
            sigaction(numbers[i], &action, NULL);
    }
}
