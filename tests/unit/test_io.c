/* Tests files: complete reading and atomic output. */
#include <dirent.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <sys/xattr.h>
#include <unistd.h>

#include "check_main.h"
#include "io/file_lock.h"
#include "io/file_source.h"
#include "io/publish.h"
#include "io/unfinished.h"
#include "scratch.h"

static const char *folder, *target;

static void enter(void)
{
    scratch_enter();
    folder = scratch(NULL);
    target = scratch("out.bin");
}

static void leave(void)
{
    unlink(target);
    ck_assert_int_eq(scratch_entries(), 0);
    scratch_leave();
}

static void write_file(const char *path, const char *content)
{
    FILE *f = fopen(path, "wb");
    ck_assert(f && fputs(content, f) >= 0 && fclose(f) == 0);
}

static void check_content(const char *path, const char *content)
{
    ebpo_whole_file file;
    ck_assert(ebpo_whole_file_open(&file, path, NULL) == EBPO_OK);
    ck_assert(ebpo_whole_file_load(&file, NULL, 1, NULL, path, NULL) == EBPO_OK);
    ck_assert(file.size == strlen(content) && memcmp(file.data, content, file.size) == 0);
    ebpo_whole_file_close(&file);
}

START_TEST(test_output_appears_on_commit_only)
{
    ebpo_publish out;
    mode_t mask = umask(027);
    struct stat st;
    write_file(target, "old");
    ck_assert(ebpo_publish_begin(&out, target, NULL) == EBPO_OK);
    fputs("new", ebpo_publish_stream(&out));
    check_content(target, "old");
    ck_assert(scratch_entries() == 2);
    ck_assert(ebpo_publish_commit(&out, NULL) == EBPO_OK);
    check_content(target, "new");
    ck_assert(scratch_entries() == 1 && stat(target, &st) == 0 && (st.st_mode & 0777) == 0640);
    ebpo_publish_abort(&out);
    check_content(target, "new");
    umask(mask);
}
END_TEST

START_TEST(test_output_by_name_is_published)
{
    ebpo_publish out;
    ck_assert(ebpo_publish_begin(&out, target, NULL) == EBPO_OK);
    write_file(ebpo_publish_path(&out), "by name");
    ck_assert(ebpo_publish_commit(&out, NULL) == EBPO_OK);
    check_content(target, "by name");
}
END_TEST

START_TEST(test_aborted_output_leaves_nothing)
{
    ebpo_publish out;
    write_file(target, "old");
    ck_assert(ebpo_publish_begin(&out, target, NULL) == EBPO_OK);
    fputs("new", ebpo_publish_stream(&out));
    ebpo_publish_abort(&out);
    ebpo_publish_abort(&out);
    ck_assert(scratch_entries() == 1);
    check_content(target, "old");
}
END_TEST

START_TEST(test_commit_without_temporary_file_fails)
{
    ebpo_publish out;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_publish_begin(&out, target, NULL) == EBPO_OK);
    unlink(ebpo_publish_path(&out));
    ck_assert(ebpo_publish_commit(&out, &error) == EBPO_E_IO);
    ck_assert(scratch_entries() == 0 && strstr(error.message, target) != NULL);
}
END_TEST

static void refused(const char *path, const char *message)
{
    ebpo_publish out;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_publish_begin(&out, path, &error) == EBPO_E_IO);
    ck_assert_msg(strstr(error.message, message) && strstr(error.message, path), "%s",
                  error.message);
}

START_TEST(test_irreplaceable_targets_are_refused)
{
    char path[128], file[64];
    refused(folder, "is a folder");
    refused("/dev/null", "is a pipe or device");
    snprintf(path, sizeof path, "%s/", folder);
    refused(path, "the path ends with");
    snprintf(path, sizeof path, "%s/absent/out.bin", folder);
    refused(path, "No such file");
    snprintf(file, sizeof file, "%s/link", folder);
    ck_assert(symlink(target, file) == 0);
    refused(file, "is a symbolic link");
    unlink(file);
    if (geteuid() != 0) { /* root may write to all files */
        chmod(folder, 0500);
        refused(target, "Permission denied");
        chmod(folder, 0700);
    }
    ck_assert(scratch_entries() == 0);
}
END_TEST

START_TEST(test_output_slots_are_limited_and_reused)
{
    ebpo_file_lock lock;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_publish out[EBPO_UNFINISHED_MAX], last;
    for (int round = 0; round < 2; round++) {
        for (int i = 0; i < EBPO_UNFINISHED_MAX; i++)
            ck_assert(ebpo_publish_begin(&out[i], target, NULL) == EBPO_OK);
        ck_assert(ebpo_publish_begin(&last, target, NULL) == EBPO_E_LIMIT);
        ebpo_publish_abort(&out[0]);
        ck_assert(ebpo_file_lock_take(&lock, target, 0, NULL, NULL) == EBPO_OK && lock.slot >= 0);
        ck_assert(ebpo_publish_begin(&last, target, &error) == EBPO_E_LIMIT);
        ck_assert(strstr(error.message, "more than 32 files at a time") != NULL);
        ebpo_file_lock_release(&lock);
        for (int i = 1; i < EBPO_UNFINISHED_MAX; i++)
            ebpo_publish_abort(&out[i]);
    }
    ck_assert(scratch_entries() == 0);
}
END_TEST

static void on_signal(int number)
{
    (void)number;
    ebpo_unfinished_remove();
    _exit(3);
}

START_TEST(test_signal_handler_removes_unfinished_output)
{
    pid_t child = fork();
    if (child == 0) {
        ebpo_publish done, open1, open2;
        signal(SIGTERM, on_signal);
        if (ebpo_publish_begin(&done, target, NULL) || ebpo_publish_commit(&done, NULL) ||
            ebpo_publish_begin(&open1, target, NULL) || ebpo_publish_begin(&open2, target, NULL) ||
            scratch_entries() != 3)
            _exit(1);
        raise(SIGTERM);
    }
    int status;
    ck_assert(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 3);
    ck_assert(scratch_entries() == 1);
}
END_TEST

/* The path has a parent folder, a last part of one letter, and slashes at the end. */
START_TEST(test_folder_of_ended_process_is_removed)
{
    char path[400], *making;
    snprintf(path, sizeof path, "%s/f//", folder);
    pid_t child = fork();
    if (child == 0)
        _exit(ebpo_folder_begin(path, &making, NULL) == EBPO_OK ? 0 : 1);
    int status;
    ck_assert(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
    ck_assert_int_eq(scratch_entries(), 1);
    ck_assert(ebpo_folder_begin(path, &making, NULL) == EBPO_OK);
    ck_assert_int_eq(scratch_entries(), 1);
    ck_assert(strncmp(making, path, strlen(path) - 2) == 0 && rmdir(making) == 0);
    free(making);
}
END_TEST

/* --- locks, and outputs made from the files that they replace --- */

START_TEST(test_lock_waits_and_leaves_no_file)
{
    ebpo_file_lock lock, other;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_file_lock_take(&lock, target, 0, NULL, NULL) == EBPO_OK && lock.fd >= 0);
    ck_assert(ebpo_file_lock_take(&other, target, 0.1, NULL, &error) == EBPO_E_IO);
    ck_assert(other.fd == -1 &&
              strstr(error.message, "has been changing the file for 0.1 s") != NULL);
    ebpo_file_lock_release(&lock);
    ck_assert(scratch_entries() == 0);
    ck_assert(ebpo_file_lock_take(&other, target, 0, NULL, NULL) == EBPO_OK && other.fd >= 0);
    ebpo_file_lock_release(&other);
}
END_TEST

static bool stop(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)done, (void)total;
    ++*(int *)user;
    return strcmp(stage, "waiting") != 0;
}

START_TEST(test_lock_wait_can_be_cancelled)
{
    ebpo_file_lock lock, other;
    int calls = 0;
    const ebpo_progress progress = { stop, &calls };
    ck_assert(ebpo_file_lock_take(&lock, target, 0, &progress, NULL) == EBPO_OK);
    ck_assert(ebpo_file_lock_take(&other, target, 60, &progress, NULL) == EBPO_E_CANCELLED);
    ck_assert(calls == 1);
    ebpo_file_lock_release(&lock);
}
END_TEST

/* Takes the lock without the privileges of root, who may write to all files. */
static int lock_as_nobody(void)
{
    enum { NOBODY = 65534 };
    ebpo_file_lock lock;
    if (geteuid() == 0 && setuid(NOBODY) != 0)
        return 1;
    alarm(3);
    if (ebpo_file_lock_take(&lock, target, 0, NULL, NULL) != EBPO_OK || lock.fd != -1)
        return 2;
    ebpo_file_lock_release(&lock);
    return 0;
}

START_TEST(test_lock_skips_read_only_folder)
{
    int status;
    ck_assert(chmod(folder, 0555) == 0);
    pid_t child = fork();
    if (child == 0)
        _exit(lock_as_nobody());
    ck_assert(waitpid(child, &status, 0) == child && status == 0);
    ck_assert(chmod(folder, 0700) == 0 && scratch_entries() == 0);
}
END_TEST

START_TEST(test_lock_keeps_unrelated_file)
{
    ebpo_file_lock lock;
    const char *named = scratch(".out.bin.lock");
    for (int pipe = 0; pipe < 2; pipe++) {
        if (pipe)
            ck_assert(unlink(named) == 0 && mkfifo(named, 0600) == 0);
        else
            write_file(named, "kept");
        ck_assert(ebpo_file_lock_take(&lock, target, 0, NULL, NULL) == EBPO_OK && lock.fd == -1);
        ebpo_file_lock_release(&lock);
        if (!pipe)
            check_content(named, "kept");
        ck_assert(scratch_entries() == 1);
    }
    unlink(named);
}
END_TEST

/* Increases the number in the file by one. Many processes run this function, and no increase is
 * lost. */
static int count_up(void)
{
    for (int i = 0; i < 25; i++) {
        ebpo_file_lock lock;
        char text[16] = "0";
        if (ebpo_file_lock_take(&lock, target, 60, NULL, NULL) != EBPO_OK || lock.fd < 0)
            return 1;
        FILE *f = fopen(target, "r");
        if (!f || !fgets(text, sizeof text, f) || fclose(f) != 0)
            return 2;
        snprintf(text, sizeof text, "%d", atoi(text) + 1);
        if (ebpo_write_file(target, text, strlen(text), NULL) != EBPO_OK)
            return 3;
        ebpo_file_lock_release(&lock);
    }
    return 0;
}

START_TEST(test_lock_serializes_processes)
{
    enum { PROCESSES = 4 };
    pid_t child[PROCESSES];
    int status;
    write_file(target, "0");
    for (int i = 0; i < PROCESSES; i++)
        if ((child[i] = fork()) == 0)
            _exit(count_up());
    for (int i = 0; i < PROCESSES; i++)
        ck_assert(waitpid(child[i], &status, 0) == child[i] && status == 0);
    check_content(target, "100");
    ck_assert(scratch_entries() == 1);
}
END_TEST

START_TEST(test_output_replaces_only_its_source_version)
{
    ebpo_publish out;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_whole_file read;
    write_file(target, "old");
    ck_assert(ebpo_whole_file_open(&read, target, NULL) == EBPO_OK);
    ebpo_file_version version = ebpo_file_version_of(read.fd);
    for (int changed = 0; changed < 2; changed++) {
        ck_assert(ebpo_publish_begin(&out, target, NULL) == EBPO_OK);
        ebpo_publish_expect(&out, &version, false);
        fputs("new", ebpo_publish_stream(&out));
        if (changed)
            ck_assert(ebpo_write_file(target, "her", 3, NULL) == EBPO_OK);
        else
            ck_assert(ebpo_publish_commit(&out, NULL) == EBPO_OK);
    }
    ck_assert(ebpo_publish_commit(&out, &error) == EBPO_E_IO);
    ck_assert(strstr(error.message, "another program has changed the file since it was read") !=
              NULL);
    check_content(target, "her");
    ck_assert(scratch_entries() == 1);
    ebpo_whole_file_close(&read);
}
END_TEST

static int write_pair(const char *second_path)
{
    ebpo_publish first, second;
    if (ebpo_publish_begin(&first, target, NULL) || ebpo_publish_begin(&second, second_path, NULL))
        return 1;
    fputs("new", ebpo_publish_stream(&first));
    fputs("new", ebpo_publish_stream(&second));
    return ebpo_publish_commit_pair(&first, &second, NULL) != EBPO_OK;
}

/* When two programs write the same two files at once, one of them waits. A file of one program
 * never stays beside a file of the other. */
START_TEST(test_output_pairs_are_published_in_turn)
{
    ebpo_file_lock lock;
    const char *other = scratch("other.bin");
    int status;
    write_file(target, "old");
    write_file(other, "old");
    ck_assert(ebpo_file_lock_take(&lock, target, 0, NULL, NULL) == EBPO_OK);
    pid_t child = fork();
    if (child == 0)
        _exit(write_pair(other));
    usleep(300000);
    ck_assert(waitpid(child, &status, WNOHANG) == 0);
    check_content(target, "old");
    check_content(other, "old");
    ebpo_file_lock_release(&lock);
    ck_assert(waitpid(child, &status, 0) == child && status == 0);
    check_content(target, "new");
    check_content(other, "new");
    unlink(other);
}
END_TEST

START_TEST(test_empty_file_has_no_bytes)
{
    write_file(target, "");
    check_content(target, "");
}
END_TEST

START_TEST(test_output_keeps_mode_and_attributes)
{
    ebpo_publish out;
    struct stat st;
    char value[8] = "";
    write_file(target, "old");
    ck_assert(chmod(target, 0604) == 0);
    bool has =
        setxattr(target, "user.ebpo", "kept", 4, 0) == 0; /* not all file systems support them */
    ck_assert(ebpo_publish_begin(&out, target, NULL) == EBPO_OK);
    fputs("new", ebpo_publish_stream(&out));
    ck_assert(ebpo_publish_commit(&out, NULL) == EBPO_OK);
    check_content(target, "new");
    ck_assert(stat(target, &st) == 0 && (st.st_mode & 07777) == 0604);
#ifndef EBPO_HAVE_XATTR
    has = false; /* not all systems support them; then the attributes are lost */
#endif
    ck_assert(!has || (getxattr(target, "user.ebpo", value, sizeof value) == 4 &&
                       memcmp(value, "kept", 4) == 0));
}
END_TEST

START_TEST(test_change_while_reading_is_detected)
{
    ebpo_whole_file file;
    write_file(target, "one");
    ck_assert(ebpo_whole_file_open(&file, target, NULL) == EBPO_OK);
    ck_assert(ebpo_whole_file_unchanged(&file, target, NULL) == EBPO_OK);
    write_file(target, "longer");
    ck_assert(ebpo_whole_file_unchanged(&file, target, NULL) == EBPO_E_IO);
    ebpo_whole_file_close(&file);
}
END_TEST

/* Restores the old times, as copying with times or unpacking an archive does. */
static void set_back(const char *path, const struct stat *old)
{
    struct timespec times[2] = { old->st_atim, old->st_mtim };
    ck_assert(utimensat(AT_FDCWD, path, times, 0) == 0);
}

START_TEST(test_change_with_reset_time_is_detected)
{
    ebpo_whole_file file;
    struct stat old;
    write_file(target, "one");
    ck_assert(stat(target, &old) == 0 && ebpo_whole_file_open(&file, target, NULL) == EBPO_OK);
    ck_assert(ebpo_whole_file_load(&file, NULL, 2, NULL, target, NULL) == EBPO_OK);
    write_file(target, "two");
    set_back(target, &old);
    ck_assert(ebpo_whole_file_unchanged(&file, target, NULL) == EBPO_E_IO);
    write_file(target, "one");
    set_back(target, &old);
    ck_assert(ebpo_whole_file_unchanged(&file, target, NULL) == EBPO_OK);
    ebpo_whole_file_close(&file);
}
END_TEST

START_TEST(test_shrinking_file_is_an_error)
{
    ebpo_whole_file file;
    ebpo_error error = EBPO_ERROR_INIT;
    char byte;
    write_file(target, "some bytes");
    ck_assert(ebpo_whole_file_open(&file, target, NULL) == EBPO_OK && truncate(target, 4) == 0);
    ck_assert(ebpo_whole_file_load(&file, NULL, 1, NULL, target, &error) == EBPO_E_IO);
    ck_assert(strstr(error.message, "became shorter while it was read") != NULL);
    ck_assert(ebpo_whole_file_read(&file, 4, &byte, 1, target, &error) == EBPO_E_IO);
    ck_assert(ebpo_whole_file_read(&file, 3, &byte, 1, target, &error) == EBPO_OK && byte == 'e');
    ebpo_whole_file_close(&file);
}
END_TEST

START_TEST(test_pipes_and_folders_are_refused)
{
    ebpo_whole_file file;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(mkfifo(target, 0600) == 0);
    ck_assert(ebpo_whole_file_open(&file, target, &error) == EBPO_E_IO &&
              strstr(error.message, "pipe") != NULL);
    ck_assert(ebpo_whole_file_open(&file, folder, &error) == EBPO_E_IO &&
              strstr(error.message, "folder") != NULL);
    ck_assert(file.fd == -1 && !file.data);
}
END_TEST

TEST_SUITE(io)
{
    TCase *tests = tcase_create("io");
    tcase_add_checked_fixture(tests, enter, leave);
    tcase_add_test(tests, test_output_appears_on_commit_only);
    tcase_add_test(tests, test_output_by_name_is_published);
    tcase_add_test(tests, test_aborted_output_leaves_nothing);
    tcase_add_test(tests, test_commit_without_temporary_file_fails);
    tcase_add_test(tests, test_irreplaceable_targets_are_refused);
    tcase_add_test(tests, test_output_slots_are_limited_and_reused);
    tcase_add_test(tests, test_signal_handler_removes_unfinished_output);
    tcase_add_test(tests, test_folder_of_ended_process_is_removed);
    tcase_add_test(tests, test_lock_waits_and_leaves_no_file);
    tcase_add_test(tests, test_lock_wait_can_be_cancelled);
    tcase_add_test(tests, test_lock_skips_read_only_folder);
    tcase_add_test(tests, test_lock_keeps_unrelated_file);
    tcase_add_test(tests, test_lock_serializes_processes);
    tcase_add_test(tests, test_output_replaces_only_its_source_version);
    tcase_add_test(tests, test_output_pairs_are_published_in_turn);
    tcase_add_test(tests, test_empty_file_has_no_bytes);
    tcase_add_test(tests, test_output_keeps_mode_and_attributes);
    tcase_add_test(tests, test_change_while_reading_is_detected);
    tcase_add_test(tests, test_change_with_reset_time_is_detected);
    tcase_add_test(tests, test_shrinking_file_is_an_error);
    tcase_add_test(tests, test_pipes_and_folders_are_refused);
    Suite *suite = suite_create("io");
    suite_add_tcase(suite, tests);
    return suite;
}
