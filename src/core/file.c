/* Files: the whole content of one as memory, and one that appears under its name only when complete.
 * SPDX-License-Identifier: MIT */
#include "file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

static pbr_result io_error(pbr_instance *instance, const char *path, const char *doing, int error) {
    char text[128] = "";
    return pbr_log(instance, PBR_LOG_ERROR, PBR_ERROR_IO, "%s: cannot %s: %s", path, doing, strerror_r(error, text, sizeof text));
}

/* Reads to the end of a file whose size may be unknown. `expected` is a first guess. */
static pbr_result read_all(pbr_instance *instance, const char *path, int file, size_t expected, struct source *out) {
    size_t capacity = expected + 1, size = 0; /* one more, so that the end is met without growing */
    if (capacity < 65536) capacity = 65536;
    unsigned char *data = pbr_allocate(instance, capacity, 1);
    if (!data) return PBR_ERROR_OUT_OF_MEMORY;
    for (;;) {
        if (size == capacity) {
            unsigned char *grown = capacity > SIZE_MAX / 2 ? NULL : pbr_reallocate(instance, data, capacity, capacity * 2, 1);
            if (!grown) {
                pbr_free(instance, data);
                return PBR_ERROR_OUT_OF_MEMORY;
            }
            data = grown;
            capacity *= 2;
        }
        size_t room = capacity - size < 1 << 30 ? capacity - size : 1 << 30;
        ssize_t got = read(file, data + size, room);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) {
            pbr_free(instance, data);
            return io_error(instance, path, "read", errno);
        }
        if (got == 0) break;
        size += (size_t)got;
    }
    out->data = data;
    out->size = size;
    return PBR_OK;
}

pbr_result source_open(pbr_instance *instance, const char *path, bool stream, struct source *out) {
    *out = (struct source){.instance = instance};
    pbr_result result = PBR_OK;
    struct stat info;
    int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) return io_error(instance, path, "open", errno);
    if (fstat(file, &info) != 0) {
        result = io_error(instance, path, "open", errno);
        goto cleanup;
    }
    bool regular = S_ISREG(info.st_mode);
    /* Devices are refused: some never end. */
    if (!regular && !S_ISFIFO(info.st_mode) && !S_ISSOCK(info.st_mode)) {
        result = io_error(instance, path, "read", S_ISDIR(info.st_mode) ? EISDIR : EINVAL);
        goto cleanup;
    }
    if (regular && ((uint64_t)info.st_size >= SIZE_MAX)) {
        result = io_error(instance, path, "read", EFBIG);
        goto cleanup;
    }
    if (!regular || stream || info.st_size == 0) {
        result = read_all(instance, path, file, regular ? (size_t)info.st_size : 0, out);
        goto cleanup;
    }
    void *data = mmap(NULL, (size_t)info.st_size, PROT_READ, MAP_PRIVATE, file, 0);
    if (data == MAP_FAILED) {
        result = io_error(instance, path, "map", errno);
        goto cleanup;
    }
    *out = (struct source){.instance = instance, .data = data, .size = (size_t)info.st_size, .mapped = true};
cleanup:
    close(file);
    return result;
}

void source_read_at_random(const struct source *source) {
    if (source->mapped) posix_madvise((void *)(uintptr_t)source->data, source->size, POSIX_MADV_RANDOM);
}

void source_done_with(const struct source *source, size_t begin, size_t size) {
    const size_t page = (size_t)sysconf(_SC_PAGESIZE), first = (begin + page - 1) / page * page, end = (begin + size) / page * page;
    /* Whole pages only. They come back when they are read, from the system's cache if it kept them. */
    if (source->mapped && first < end) madvise((void *)(uintptr_t)(source->data + first), end - first, MADV_DONTNEED);
}

void source_close(struct source *source) {
    if (!source->data) return;
    if (source->mapped) munmap((void *)(uintptr_t)source->data, source->size);
    else pbr_free(source->instance, (void *)(uintptr_t)source->data);
    source->data = NULL;
    source->size = 0;
}

pbr_result output_open(pbr_instance *instance, const char *path, struct output *out) {
    enum { TRIES = 1000, SUFFIX = 40 };
    *out = (struct output){.instance = instance, .path = path, .file = -1};
    struct stat info;
    if (stat(path, &info) == 0 && !S_ISREG(info.st_mode))
        return io_error(instance, path, "replace", S_ISDIR(info.st_mode) ? EISDIR : EINVAL);
    size_t room = strlen(path) + SUFFIX;
    out->temporary = pbr_allocate(instance, room, 1);
    if (!out->temporary) return PBR_ERROR_OUT_OF_MEMORY;
    /* Another thread or process may write the same picture: each takes a name that did not exist. */
    for (int i = 0; i < TRIES && out->file < 0; i++) {
        snprintf(out->temporary, room, "%s.%ld-%d.tmp", path, (long)getpid(), i);
        out->file = open(out->temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (out->file < 0 && errno != EEXIST) break;
    }
    if (out->file >= 0) return PBR_OK;
    pbr_result result = io_error(instance, path, "create", errno);
    pbr_free(instance, out->temporary);
    out->temporary = NULL;
    return result;
}

/* 0, or errno. */
static int write_at(int file, const void *data, size_t size, uint64_t offset) {
    const char *p = data;
    while (size > 0) {
        const ssize_t done = pwrite(file, p, size, (off_t)offset);
        if (done < 0 && errno != EINTR) return errno;
        if (done <= 0) continue;
        p += done;
        offset += (uint64_t)done;
        size -= (size_t)done;
    }
    return 0;
}

bool output_write(struct output *output, const void *data, size_t size, uint64_t offset) {
    if (output->error != 0) return false;
    const int error = write_at(output->file, data, size, offset);
    if (error != 0) output->error = error;
    return error == 0;
}

pbr_result output_close(struct output *output, bool keep) {
    if (!output->temporary) return PBR_OK;
    pbr_result result = PBR_OK;
    if (close(output->file) != 0 && output->error == 0) output->error = errno;
    if (keep && output->error == 0 && rename(output->temporary, output->path) != 0) output->error = errno;
    if (output->error != 0) result = io_error(output->instance, output->path, "write", output->error);
    if (!keep || output->error != 0) unlink(output->temporary);
    pbr_free(output->instance, output->temporary);
    output->temporary = NULL;
    return result;
}

pbr_result scratch_open(pbr_instance *instance, const char *beside, int *file) {
    struct output output;
    pbr_result result = output_open(instance, beside, &output);
    *file = -1;
    if (result != PBR_OK) return result;
    *file = open(output.temporary, O_RDWR | O_CLOEXEC);
    if (*file < 0) output.error = errno;
    close(output.file);
    unlink(output.temporary);
    pbr_free(instance, output.temporary);
    return *file < 0 ? io_error(instance, beside, "create a temporary file beside it", output.error) : PBR_OK;
}

void scratch_close(int file) {
    if (file >= 0) close(file);
}

pbr_result scratch_write(pbr_instance *instance, const char *beside, int file, const void *data, size_t size, uint64_t offset) {
    const int error = write_at(file, data, size, offset);
    return error == 0 ? PBR_OK : io_error(instance, beside, "write the temporary file beside it", error);
}

pbr_result scratch_read(pbr_instance *instance, const char *beside, int file, void *data, size_t size, uint64_t offset) {
    char *p = data;
    while (size > 0) {
        const ssize_t done = pread(file, p, size, (off_t)offset);
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) return io_error(instance, beside, "read the temporary file beside it", done < 0 ? errno : EIO);
        p += done;
        offset += (uint64_t)done;
        size -= (size_t)done;
    }
    return PBR_OK;
}
