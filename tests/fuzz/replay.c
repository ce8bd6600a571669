/* Runs a fuzz target on files and on all files of folders: each must pass. For builds without libFuzzer.
 * SPDX-License-Identifier: MIT */
#include "fuzz.h"

#include <dirent.h>
#include <sys/stat.h>

/* In memory of exactly the file's size, so that a sanitizer sees a read past its end. */
static int replay_file(const char *path, size_t size) {
    uint8_t *data = malloc(size ? size : 1);
    FILE *file = fopen(path, "rb");
    bool ok = data && file && fread(data, 1, size, file) == size;
    if (file) fclose(file);
    if (ok) {
        printf("%s\n", path); /* before, so that the last line names the one that fails */
        fflush(stdout);
        LLVMFuzzerTestOneInput(data, size);
    } else {
        fprintf(stderr, "%s: cannot be read\n", path);
    }
    free(data);
    return ok ? 1 : -1;
}

/* Number of files, or -1. */
static int replay(const char *path) {
    struct stat info;
    if (stat(path, &info) != 0) {
        fprintf(stderr, "%s: does not exist\n", path);
        return -1;
    }
    if (!S_ISDIR(info.st_mode)) return replay_file(path, (size_t)info.st_size);
    struct dirent **entries = NULL;
    int count = scandir(path, &entries, NULL, alphasort), files = 0;
    for (int i = 0; i < count; i++) {
        char inside[4096];
        snprintf(inside, sizeof inside, "%s/%s", path, entries[i]->d_name);
        int got = entries[i]->d_name[0] == '.' ? 0 : replay(inside);
        files = got < 0 || files < 0 ? -1 : files + got;
        free(entries[i]);
    }
    free(entries);
    return files;
}

int main(int argc, char **argv) {
    int files = 0;
    for (int i = 1; i < argc; i++) {
        int got = replay(argv[i]);
        if (got <= 0) {
            fprintf(stderr, "%s: nothing to replay\n", argv[i]);
            return 1;
        }
        files += got;
    }
    printf("%d files\n", files);
    return files == 0;
}
