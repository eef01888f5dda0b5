#include "cli/signals.h"

#include <ebpo/base.h>
#include <signal.h>
#include <string.h>

static void (*volatile command_cleanup)(void);
static void (*volatile scratch_cleanup)(void);

void signals_set_cleanup(void (*clean_up)(void)) { command_cleanup = clean_up; }

void signals_set_scratch_cleanup(void (*clean_up)(void)) { scratch_cleanup = clean_up; }

static void give_up(int number)
{
    ebpo_abandon_outputs();
    if (command_cleanup)
        command_cleanup();
    if (scratch_cleanup)
        scratch_cleanup();
    /* SA_RESETHAND has restored the default action, so raising the signal again ends the process,
     * and the parent process sees the signal. Just before, outputs are removed once more, because
     * another thread may have opened an output meanwhile. */
    sigset_t only;
    sigemptyset(&only);
    sigaddset(&only, number);
    pthread_sigmask(SIG_UNBLOCK, &only, NULL);
    ebpo_abandon_outputs();
    raise(number);
}

void signals_install(void)
{
    /* Without SIGXFSZ, a write beyond the limit on file size fails with an error, as on a full
     * disk. */
    signal(SIGXFSZ, SIG_IGN);
    /* SIGPIPE arrives when the reader of the output (such as `head`) has read enough. */
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
