/* The files that a file names. SPDX-License-Identifier: MIT */
#include "beside.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MOST_NAME = 1024 };

/* Opens the folder of the reader's file: -1 with errno set if it cannot be. */
static pbr_result open_folder(const struct reader *reader, int *out) {
    const char *slash = strrchr(reader->path, '/');
    size_t length = slash ? (size_t)(slash - reader->path) + 1 : 0;
    char *folder = pbr_allocate(reader->instance, length + 2, 1);
    if (!folder) return PBR_ERROR_OUT_OF_MEMORY;
    memcpy(folder, slash ? reader->path : ".", slash ? length : 1);
    *out = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    int error = errno;
    pbr_free(reader->instance, folder);
    errno = error;
    return PBR_OK;
}

/* The name with slashes alone; false if it could lead out of the folder. */
static bool take_name(const char *name, size_t length, char out[MOST_NAME + 1]) {
    if (length == 0 || length > MOST_NAME) return false;
    for (size_t i = 0; i < length; i++) {
        if ((unsigned char)name[i] < ' ') return false;
        out[i] = name[i] == '\\' ? '/' : name[i]; /* as other systems write it */
    }
    out[length] = 0;
    if (out[0] == '/') return false;
    for (const char *part = out; part; part = strchr(part, '/')) {
        part += *part == '/';
        if (strncmp(part, "..", 2) == 0 && (part[2] == '/' || part[2] == 0)) return false;
    }
    return true;
}

/* Opens folder after folder, so that none is a link; `name` is cut up. Returns -1 with errno set. */
static int open_below(int folder, char *name) {
    int at = folder;
    for (char *part = name; at >= 0;) {
        char *slash = strchr(part, '/');
        if (slash) *slash = 0;
        /* Not blocking: a named pipe would wait for its writer. */
        int flags = O_RDONLY | O_NOFOLLOW | O_CLOEXEC | (slash ? O_DIRECTORY : O_NONBLOCK);
        int next = *part || !slash ? openat(at, part, flags) : dup(at);
        int error = errno;
        if (at != folder) close(at);
        errno = error;
        if (!slash) return next;
        at = next;
        part = slash + 1;
    }
    return -1;
}

/* Reads `size` bytes, or as many as there are. */
static size_t read_bytes(int file, unsigned char *data, size_t size) {
    size_t done = 0;
    while (done < size) {
        ssize_t got = read(file, data + done, size - done);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) break;
        done += (size_t)got;
    }
    return done;
}

/* Sets `*why` to what went wrong, or leaves it. */
static pbr_result read_file(struct reader *reader, int file, size_t most, struct source *out, const char **why) {
    struct stat info;
    if (fstat(file, &info) != 0 || !S_ISREG(info.st_mode)) *why = "it is no regular file";
    else if ((uint64_t)info.st_size > most) *why = "it is too large";
    if (*why) return PBR_OK;
    unsigned char *data = pbr_allocate(reader->instance, (size_t)info.st_size + 1, 1);
    if (!data) return PBR_ERROR_OUT_OF_MEMORY;
    *out = (struct source){.instance = reader->instance, .data = data};
    out->size = read_bytes(file, data, (size_t)info.st_size);
    return PBR_OK;
}

pbr_result beside_read(struct reader *reader, const char *name, size_t length, size_t most, struct source *out) {
    char relative[MOST_NAME + 1], text[128] = "";
    const char *why = NULL;
    int folder = -1, file = -1;
    pbr_result result = PBR_OK;
    *out = (struct source){.instance = reader->instance};
    if (!reader->path) return PBR_OK;
    if (!take_name(name, length, relative)) {
        why = "only files in the folder of the mesh are";
        goto cleanup;
    }
    result = open_folder(reader, &folder);
    if (result != PBR_OK) goto cleanup;
    if (folder >= 0) file = open_below(folder, relative);
    if (file < 0) why = errno == ELOOP ? "it is a link" : strerror_r(errno, text, sizeof text);
    else result = read_file(reader, file, most, out, &why);
cleanup:
    if (file >= 0) close(file);
    if (folder >= 0) close(folder);
    if (why) reader_warn(reader, 1, "'%s' is not read: %s", reader_excerpt(name, name + length).text, why);
    return result;
}
