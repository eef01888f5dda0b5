#include "web.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include "scratch.h"

static pid_t server, owner;
static int server_input = -1, port, number;
static char folder[SCRATCH_LENGTH], path[sizeof folder + 16];

static bool write_file(const void *data, size_t size)
{
    scratch_make(folder);
    snprintf(path, sizeof path, "%s/served", folder);
    FILE *f = fopen(path, "wb");
    bool good = f && fwrite(data, 1, size, f) == size;
    return f && fclose(f) == 0 && good;
}

bool web_start(const char *script, const void *data, size_t size)
{
    int in[2], out[2];
    if (!write_file(data, size) || pipe2(in, O_CLOEXEC) != 0 || pipe2(out, O_CLOEXEC) != 0)
        return false;
    owner = getpid();
    server = fork();
    if (server == 0) {
        dup2(in[0], 0);
        dup2(out[1], 1);
        execlp("python3", "python3", script, path, (char *)NULL);
        _exit(127);
    }
    close(in[0]);
    close(out[1]);
    server_input = in[1]; /* closed on exec, and when this process ends */
    FILE *reported = fdopen(out[0], "r");
    bool good = server > 0 && reported && fscanf(reported, "%d", &port) == 1;
    if (reported)
        fclose(reported);
    atexit(web_stop);
    return good;
}

void web_stop(void)
{
    if (server <= 0 || getpid() != owner) /* child processes of Check also run this function */
        return;
    close(server_input);
    waitpid(server, NULL, 0);
    server = 0;
    scratch_remove(folder);
}

const char *web_url(const char *fault)
{
    static char url[300];
    snprintf(url, sizeof url, "http://127.0.0.1:%d/%s/%ld-%d", port, fault, (long)getpid(),
             number++);
    return url;
}
