/* ebpo serve: serves models and the web viewer to browsers of this machine. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/remote_args.h"
#include "cli/commands/commands.h"
#include "cli/serve/http_server.h"
#include "cli/commands/site.h"

typedef struct values {
    int64_t port, max_expansion;
    const char *viewer;
    bool json, quiet;
} values;

#include "cli/options/serve.inc"

static const values standard = { .port = 8080 };

static bool print_address(const values *v, const site *s, int port)
{
    char address[64];
    snprintf(address, sizeof address, "http://127.0.0.1:%d/", port);
    if (v->json) {
        json j;
        json_begin(&j, stdout);
        json_object(&j, NULL);
        json_text(&j, "address", address);
        site_print_models(s, &j, false);
        json_finish(&j);
    } else {
        printf("%s\n", address);
        if (!v->quiet)
            fprintf(stderr, "ebpo serve: serves %zu model%s to this machine; Ctrl-C ends it\n",
                    site_model_count(s), site_model_count(s) == 1 ? "" : "s");
    }
    return command_flush("serve");
}

static int serve_site(const values *v, site *s)
{
    http_service service = { .find = site_find, .user = s };
    int port = (int)v->port, listener = http_server_listen(&port);
    if (listener < 0) {
        fprintf(stderr,
                "ebpo serve: port %d of 127.0.0.1 cannot be used: %s; choose another one with "
                "--port, or 0 for a free one\n",
                port, strerror(errno));
        return EXIT_FAILED;
    }
    service.stop = http_server_stop_at_signals();
    if (service.stop >= 0 && !print_address(v, s, port)) {
        close(listener);
        return EXIT_FAILED;
    }
    if (service.stop >= 0 && http_server_run(listener, &service))
        return EXIT_OK;
    fprintf(stderr, "ebpo serve: the server cannot run: %s\n", strerror(errno));
    return EXIT_FAILED;
}

static int run_serve(void *given, const char **operand)
{
    const values *v = given;
    const site_options site_of = { .command = "serve",
                                   .viewer = v->viewer,
                                   .max_expansion = v->max_expansion };
    site *s = site_new(&site_of);
    int code = s ? EXIT_OK : EXIT_FAILED;
    for (int i = 0; i < ARGS_OPERANDS_MAX && operand[i] && code == EXIT_OK; i++)
        code = site_add(s, operand[i]);
    if (code == EXIT_OK)
        code = site_finish(s);
    if (code == EXIT_OK)
        code = serve_site(v, s);
    site_free(s);
    return code;
}

const command command_serve = { &spec, sizeof standard, &standard, run_serve };
