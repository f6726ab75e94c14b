/* Log of all operations of a process on files below a folder; loaded with LD_PRELOAD.
 *
 * GONIO_RECORD_ROOT: the folder. GONIO_RECORD_QUOTA: bytes that can be written there before the
 * disk is full. GONIO_RECORD_READ_ONLY: nothing can be written. recorder_begin(path) starts a log,
 * recorder_mark(n) adds a mark, recorder_kill_at(n) sends SIGKILL before the n-th entry.
 * An entry: six 64-bit numbers (kind, inode, offset, length, length of the path, length of the
 * data), then the path and the data.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

enum { CREATE = 1, WRITE, TRUNCATE, SYNC, SYNC_FOLDER, RENAME, UNLINK, MAKE_FOLDER, MARK };

static int log_fd = -1;
static long entries, kill_at = -1;

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int below_root(const char *path) {
    const char *root = getenv("GONIO_RECORD_ROOT");
    return root && strncmp(path, root, strlen(root)) == 0;
}

static void entry(int64_t kind, int64_t inode, int64_t offset, int64_t length, const char *path,
                  const char *path2, const void *data, size_t size) {
    if (log_fd < 0) return;
    if (++entries == kill_at) raise(SIGKILL);
    char paths[2 * PATH_MAX];
    int n = snprintf(paths, sizeof paths, "%s%s%s", path, *path2 ? "\n" : "", path2);
    int64_t head[6] = {kind, inode, offset, length, n, (int64_t)size};
    struct iovec parts[3] = {{head, sizeof head}, {paths, n}, {(void *)data, size}};
    if (writev(log_fd, parts, 3) < 0) _exit(70);
}

/* The inode behind a descriptor of a file below the root, or 0. */
static int64_t watched(int fd, struct stat *st, char *path) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, PATH_MAX - 1);
    if (n <= 0) return 0;
    path[n] = 0;
    return below_root(path) && fstat(fd, st) == 0 ? (int64_t)st->st_ino : 0;
}

/* Return 1 if the write is allowed, else 0 with errno set. */
static int may_write(int fd, int64_t offset, const void *data, ssize_t size) {
    static int64_t written;
    struct stat st;
    char path[PATH_MAX];
    const char *quota = getenv("GONIO_RECORD_QUOTA");
    int64_t inode = watched(fd, &st, path);
    if (!inode) return 1;
    if (quota && (written += size) > atoll(quota)) {
        errno = ENOSPC;
        return 0;
    }
    entry(WRITE, inode, offset, size, "", "", data, size);
    return 1;
}

/* Return 1, with errno set, if a file below the root must not be changed. */
static int read_only(const char *path) {
    if (!getenv("GONIO_RECORD_READ_ONLY") || !below_root(path)) return 0;
    errno = EROFS;
    return 1;
}

int recorder_begin(const char *path) {
    log_fd = REAL(open)(path, O_CREAT | O_WRONLY | O_APPEND, 0600);
    entries = 0;
    return log_fd;
}
void recorder_mark(long number) { entry(MARK, number, 0, 0, "", "", "", 0); }
void recorder_kill_at(long number) { kill_at = number; }

static int opened(int fd, const char *path, int known, int flags) {
    struct stat st;
    if (fd >= 0 && log_fd >= 0 && below_root(path) && fstat(fd, &st) == 0) {
        if (!known && (flags & O_CREAT)) entry(CREATE, st.st_ino, 0, 0, path, "", "", 0);
        else if (flags & O_TRUNC) entry(TRUNCATE, st.st_ino, 0, 0, "", "", "", 0);
    }
    return fd;
}

#define OPEN(name)                                              \
    int name(const char *path, int flags, ...) {                \
        va_list more;                                           \
        va_start(more, flags);                                  \
        mode_t mode = flags & O_CREAT ? va_arg(more, int) : 0;  \
        va_end(more);                                           \
        int known = access(path, F_OK) == 0;                    \
        if ((flags & (O_WRONLY | O_RDWR)) && read_only(path)) return -1;  \
        return opened(REAL(name)(path, flags, mode), path, known, flags); \
    }
OPEN(open)
OPEN(open64)

ssize_t write(int fd, const void *data, size_t size) {
    if (fd != log_fd) {
        off_t at = lseek(fd, 0, SEEK_CUR);
        if (at >= 0 && !may_write(fd, at, data, size)) return -1;
    }
    return REAL(write)(fd, data, size);
}
ssize_t pwrite(int fd, const void *data, size_t size, off_t at) {
    if (!may_write(fd, at, data, size)) return -1;
    return REAL(pwrite)(fd, data, size, at);
}
ssize_t pwrite64(int fd, const void *data, size_t size, off64_t at) {
    if (!may_write(fd, at, data, size)) return -1;
    return REAL(pwrite64)(fd, data, size, at);
}

static void truncated(int fd, int64_t length) {
    struct stat st;
    char path[PATH_MAX];
    int64_t inode = watched(fd, &st, path);
    if (inode) entry(TRUNCATE, inode, 0, length, "", "", "", 0);
}
int ftruncate(int fd, off_t length) { truncated(fd, length); return REAL(ftruncate)(fd, length); }
int ftruncate64(int fd, off64_t length) { truncated(fd, length); return REAL(ftruncate64)(fd, length); }

static void synced(int fd) {
    struct stat st;
    char path[PATH_MAX];
    int64_t inode = watched(fd, &st, path);
    if (inode) entry(S_ISDIR(st.st_mode) ? SYNC_FOLDER : SYNC, inode, 0, 0, path, "", "", 0);
}
/* Data count as synced once the call has returned. */
int fsync(int fd) { int done = REAL(fsync)(fd); if (done == 0) synced(fd); return done; }
int fdatasync(int fd) { int done = REAL(fdatasync)(fd); if (done == 0) synced(fd); return done; }

/* Path of a name in an open folder, as SQLite and Python's path functions give it. */
static const char *in_folder(int folder, const char *name, char *path) {
    char link[64], own[PATH_MAX];
    if (folder == AT_FDCWD || *name == '/') return name;
    snprintf(link, sizeof link, "/proc/self/fd/%d", folder);
    ssize_t n = readlink(link, own, sizeof own - 1);
    if (n <= 0) return name;
    snprintf(path, 2 * PATH_MAX, "%.*s/%s", (int)n, own, name);
    return path;
}

#define OPENAT(name)                                            \
    int name(int folder, const char *file, int flags, ...) {    \
        va_list more;                                           \
        va_start(more, flags);                                  \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, int) : 0; \
        va_end(more);                                           \
        char buffer[2 * PATH_MAX];                              \
        const char *path = in_folder(folder, file, buffer);     \
        int known = access(path, F_OK) == 0;                    \
        if ((flags & (O_WRONLY | O_RDWR)) && read_only(path)) return -1;  \
        return opened(REAL(name)(folder, file, flags, mode), path, known, flags); \
    }
OPENAT(openat)
OPENAT(openat64)

int renameat(int from_folder, const char *from, int to_folder, const char *to) {
    char old[2 * PATH_MAX], new[2 * PATH_MAX];
    const char *old_path = in_folder(from_folder, from, old);
    const char *new_path = in_folder(to_folder, to, new);
    if (read_only(new_path)) return -1;
    if (below_root(new_path)) entry(RENAME, 0, 0, 0, old_path, new_path, "", 0);
    return REAL(renameat)(from_folder, from, to_folder, to);
}
int unlinkat(int folder, const char *name, int flags) {
    char buffer[2 * PATH_MAX];
    const char *path = in_folder(folder, name, buffer);
    if (read_only(path)) return -1;
    if (below_root(path) && access(path, F_OK) == 0) entry(UNLINK, 0, 0, 0, path, "", "", 0);
    return REAL(unlinkat)(folder, name, flags);
}

int rename(const char *from, const char *to) {
    if (read_only(to)) return -1;
    if (below_root(to)) entry(RENAME, 0, 0, 0, from, to, "", 0);
    return REAL(rename)(from, to);
}
int unlink(const char *path) {
    if (read_only(path)) return -1;
    if (below_root(path) && access(path, F_OK) == 0) entry(UNLINK, 0, 0, 0, path, "", "", 0);
    return REAL(unlink)(path);
}
int mkdir(const char *path, mode_t mode) {
    if (read_only(path)) return -1;
    int done = REAL(mkdir)(path, mode);
    if (done == 0 && below_root(path)) entry(MAKE_FOLDER, 0, 0, 0, path, "", "", 0);
    return done;
}
