/* A plugin of QEMU that prints the number of instructions that a program has executed:
 *
 *     cc -shared -fPIC -o libcount.so count_instructions.c
 *     qemu-aarch64 -plugin ./libcount.so PROGRAM...
 *
 * The declarations are those of version 1 of QEMU's interface for plugins, as Debian does not
 * install qemu-plugin.h. */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>

#define EXPORTED __attribute__((visibility("default")))

struct qemu_plugin_tb;
void qemu_plugin_register_vcpu_tb_trans_cb(uint64_t id,
                                           void (*)(uint64_t, struct qemu_plugin_tb *));
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *, int, void *, uint64_t);
void qemu_plugin_register_atexit_cb(uint64_t id, void (*)(uint64_t, void *), void *);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
int qemu_plugin_install(uint64_t id, const void *info, int argc, char **argv);

EXPORTED extern int qemu_plugin_version;
EXPORTED int qemu_plugin_version = 1;

enum { ADD_U64 }; /* the only operation of qemu_plugin_register_vcpu_tb_exec_inline */
static uint64_t executed;

static void count_block(uint64_t id, struct qemu_plugin_tb *block)
{
    (void)id;
    qemu_plugin_register_vcpu_tb_exec_inline(block, ADD_U64, &executed,
                                             qemu_plugin_tb_n_insns(block));
}

static void print_count(uint64_t id, void *nothing)
{
    (void)id, (void)nothing;
    fprintf(stderr, "instructions %" PRIu64 "\n", executed);
}

EXPORTED int qemu_plugin_install(uint64_t id, const void *info, int argc, char **argv)
{
    (void)info, (void)argc, (void)argv;
    qemu_plugin_register_vcpu_tb_trans_cb(id, count_block);
    qemu_plugin_register_atexit_cb(id, print_count, NULL);
    return 0;
}
