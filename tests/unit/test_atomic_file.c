/* SPDX-License-Identifier: MIT */
#define _XOPEN_SOURCE 700 /* symlink, umask */
#include "lab/record/atomic_file.h"
#include "tests/support/scratch.h"
#include "unity.h"

#include <sys/stat.h>

void setUp(void)
{
    scratch_empty();
}

void tearDown(void) {}

static void assert_content(const char *path, const char *expected)
{
    char *text = scratch_load(path, NULL);
    TEST_ASSERT_NOT_NULL(text);
    TEST_ASSERT_EQUAL_STRING(expected, text);
    free(text);
}

static void test_atomic_file_shows_nothing_before_commit(void)
{
    const char *path = scratch_text("out.csv", "old");
    struct atomic_file file;
    struct error error = {0};
    FILE *stream = atomic_file_open(&file, path, &error);
    TEST_ASSERT_NOT_NULL(stream);
    fputs("new", stream);
    fflush(stream);
    assert_content(path, "old");
    TEST_ASSERT_EQUAL_INT(0, atomic_file_commit(&file, &error));
    assert_content(path, "new");
    TEST_ASSERT_EQUAL_INT(1, scratch_count());
}

static void test_atomic_file_leaves_everything_as_it_was_when_discarded(void)
{
    const char *path = scratch_text("out.csv", "old");
    struct atomic_file file;
    struct error error = {0};
    fputs("new", atomic_file_open(&file, path, &error));
    atomic_file_discard(&file);
    atomic_file_discard(&file);
    assert_content(path, "old");
    TEST_ASSERT_EQUAL_INT(1, scratch_count());
}

static void test_atomic_file_takes_the_umask_and_keeps_an_old_mode(void)
{
    struct stat now;
    struct atomic_file file;
    struct error error = {0};
    mode_t mask = umask(027);
    const char *path = scratch_path("out.csv");
    TEST_ASSERT_NOT_NULL(atomic_file_open(&file, path, &error));
    TEST_ASSERT_EQUAL_INT(0, atomic_file_commit(&file, &error));
    umask(mask);
    TEST_ASSERT_EQUAL_INT(0, stat(path, &now));
    TEST_ASSERT_EQUAL_HEX(0640, now.st_mode & 0777);
    chmod(path, 0604);
    TEST_ASSERT_NOT_NULL(atomic_file_open(&file, path, &error));
    TEST_ASSERT_EQUAL_INT(0, atomic_file_commit(&file, &error));
    TEST_ASSERT_EQUAL_INT(0, stat(path, &now));
    TEST_ASSERT_EQUAL_HEX(0604, now.st_mode & 0777);
}

static void test_atomic_file_replaces_what_a_link_leads_to(void)
{
    const char *target = scratch_text("target.csv", "old"), *link = scratch_path("link.csv");
    TEST_ASSERT_EQUAL_INT(0, symlink(target, link));
    struct atomic_file file;
    struct error error = {0};
    fputs("new", atomic_file_open(&file, link, &error));
    TEST_ASSERT_EQUAL_INT(0, atomic_file_commit(&file, &error));
    assert_content(target, "new");
    struct stat now;
    TEST_ASSERT_EQUAL_INT(0, lstat(link, &now));
    TEST_ASSERT_TRUE(S_ISLNK(now.st_mode));
}

static void test_atomic_file_writes_a_device_in_place(void)
{
    struct atomic_file file;
    struct error error = {0};
    struct stat now;
    fputs("new", atomic_file_open(&file, "/dev/null", &error));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, atomic_file_commit(&file, &error), error.message);
    TEST_ASSERT_EQUAL_INT(0, stat("/dev/null", &now));
    TEST_ASSERT_TRUE(S_ISCHR(now.st_mode));
}

static void test_atomic_file_refuses_a_folder_and_a_missing_folder(void)
{
    struct atomic_file file;
    struct error error = {0};
    TEST_ASSERT_NULL(atomic_file_open(&file, scratch_folder, &error));
    TEST_ASSERT_EQUAL_INT(error_refused, error.status);
    TEST_ASSERT_NOT_NULL(strstr(error.message, "is a folder"));
    TEST_ASSERT_NULL(atomic_file_open(&file, scratch_path("missing/out.csv"), &error));
    TEST_ASSERT_NOT_NULL(strstr(error.message, "No such file"));
    atomic_file_discard(&file);
    TEST_ASSERT_EQUAL_INT(error_refused, atomic_file_commit(&file, &error));
}

int main(void)
{
    scratch_open();
    UNITY_BEGIN();
    RUN_TEST(test_atomic_file_shows_nothing_before_commit);
    RUN_TEST(test_atomic_file_leaves_everything_as_it_was_when_discarded);
    RUN_TEST(test_atomic_file_takes_the_umask_and_keeps_an_old_mode);
    RUN_TEST(test_atomic_file_replaces_what_a_link_leads_to);
    RUN_TEST(test_atomic_file_writes_a_device_in_place);
    RUN_TEST(test_atomic_file_refuses_a_folder_and_a_missing_folder);
    int failures = UNITY_END();
    scratch_close();
    return failures;
}
