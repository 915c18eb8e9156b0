/* Lets one system call on the files of a folder fail. Loaded by LD_PRELOAD; armed from Python. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

static char folder[4096];
static long at, count;
static int error, onwards;
char failed[256];

/* Calls are counted from here on. The call of number `n` fails; with `all` those that need space fail after it too. */
void arm(const char *path, long n, int code, int all) {
    strncpy(folder, path, sizeof folder - 1);
    at = n, count = 0, error = code, onwards = all, failed[0] = 0;
}

long counted(void) { return count; }

static int fails(const char *name, const char *path, int needs_space) {
    if (!folder[0] || !path || strncmp(path, folder, strlen(folder))) return 0;
    count++;
    if (count != at && !(onwards && needs_space && at && count > at)) return 0;
    if (onwards && !needs_space) return 0;
    if (!failed[0]) snprintf(failed, sizeof failed, "%s %s", name, path + strlen(folder));
    errno = error;
    return 1;
}

static int fails_on(const char *name, int file, int needs_space) {
    char link[64], path[4096];
    if (!folder[0]) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return fails(name, path, needs_space);
}

#define REAL(type, name, ...) static type (*real)(__VA_ARGS__); if (!real) real = dlsym(RTLD_NEXT, name)

#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        REAL(int, #name, const char *, int, ...); \
        va_list rest; va_start(rest, flags); mode_t mode = va_arg(rest, mode_t); va_end(rest); \
        return fails("open", path, flags & O_CREAT) ? -1 : real(path, flags, mode); \
    }
OPEN(open)
OPEN(open64)

#define ON_FILE(type, name, space, parameters, arguments) \
    type name parameters { \
        static type (*real) parameters; if (!real) real = dlsym(RTLD_NEXT, #name); \
        return fails_on(#name, file, space) ? -1 : real arguments; \
    }
ON_FILE(ssize_t, write, 1, (int file, const void *data, size_t size), (file, data, size))
ON_FILE(ssize_t, pwrite, 1, (int file, const void *data, size_t size, off_t where), (file, data, size, where))
ON_FILE(ssize_t, pwrite64, 1, (int file, const void *data, size_t size, off64_t where), (file, data, size, where))
ON_FILE(ssize_t, read, 0, (int file, void *data, size_t size), (file, data, size))
ON_FILE(ssize_t, pread, 0, (int file, void *data, size_t size, off_t where), (file, data, size, where))
ON_FILE(ssize_t, pread64, 0, (int file, void *data, size_t size, off64_t where), (file, data, size, where))
ON_FILE(int, fsync, 1, (int file), (file))
ON_FILE(int, ftruncate, 1, (int file, off_t size), (file, size))
ON_FILE(int, ftruncate64, 1, (int file, off64_t size), (file, size))
ON_FILE(int, fchmod, 0, (int file, mode_t mode), (file, mode))

#define ON_PATH(name, space, parameters, arguments) \
    int name parameters { \
        static int (*real) parameters; if (!real) real = dlsym(RTLD_NEXT, #name); \
        return fails(#name, path, space) ? -1 : real arguments; \
    }
ON_PATH(mkdir, 1, (const char *path, mode_t mode), (path, mode))
ON_PATH(rename, 0, (const char *path, const char *to), (path, to))
ON_PATH(unlink, 0, (const char *path), (path))
ON_PATH(rmdir, 0, (const char *path), (path))
ON_PATH(chmod, 0, (const char *path, mode_t mode), (path, mode))

/* The file is closed nevertheless, as Linux does it. */
int close(int file) {
    static int (*real)(int);
    if (!real) real = dlsym(RTLD_NEXT, "close");
    int writes = (fcntl(file, F_GETFL) & O_ACCMODE) != O_RDONLY;
    int failing = writes && fails_on("close", file, 1), code = errno, result = real(file);
    if (failing) errno = code;
    return failing ? -1 : result;
}
