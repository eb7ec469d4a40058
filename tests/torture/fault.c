/* Loaded before the C library: counts what is written below a folder, and fails at one of them. */
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

static char below[4096];
static long left = -1, seen = 0;
static int code = 0, lasting = 0;

/* From now on: fail after `after` calls with error `error`; for good if `stay`, else once. */
void fault_arm(const char *folder, long after, int error, int stay) {
  snprintf(below, sizeof below, "%s", folder);
  left = after, code = error, lasting = stay, seen = 0;
}

long fault_seen(void) { return seen; }

static int fails(const char *path) {
  if (left < 0 || strncmp(path, below, strlen(below))) return 0;
  seen++;
  if (left > 0) return left--, 0;
  if (!lasting) left = -1;
  errno = code;
  return 1;
}

static int fails_at(const char *path) {
  char place[8192];
  if (path[0] == '/') return fails(path);
  if (!getcwd(place, 4096)) return 0;
  strncat(place, "/", 2);
  strncat(place, path, 4000);
  return fails(place);
}

static int fails_open(int file) {
  char link[64], place[4096];
  if (left < 0) return 0;
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  ssize_t size = readlink(link, place, sizeof place - 1);
  if (size < 0) return 0;
  place[size] = 0;
  return fails(place);
}

#define NEXT(type, name, ...) type (*next)(__VA_ARGS__) = dlsym(RTLD_NEXT, #name)

#define OPEN(name)                                                      \
  int name(const char *path, int flags, ...) {                          \
    va_list rest;                                                       \
    va_start(rest, flags);                                              \
    mode_t mode = va_arg(rest, mode_t);                                 \
    va_end(rest);                                                       \
    NEXT(int, name, const char *, int, ...);                            \
    if ((flags & O_CREAT) && fails_at(path)) return -1;       \
    return next(path, flags, mode);                                     \
  }
OPEN(open)
OPEN(open64)

ssize_t write(int file, const void *data, size_t size) {
  NEXT(ssize_t, write, int, const void *, size_t);
  return fails_open(file) ? -1 : next(file, data, size);
}

ssize_t sendfile64(int to, int from, off64_t *at, size_t size) {
  NEXT(ssize_t, sendfile64, int, int, off64_t *, size_t);
  return fails_open(to) ? -1 : next(to, from, at, size);
}

int fsync(int file) {
  NEXT(int, fsync, int);
  return fails_open(file) ? -1 : next(file);
}

int mkdir(const char *path, mode_t mode) {
  NEXT(int, mkdir, const char *, mode_t);
  return fails_at(path) ? -1 : next(path, mode);
}

int rename(const char *from, const char *to) {
  NEXT(int, rename, const char *, const char *);
  return fails_at(to) ? -1 : next(from, to);
}
