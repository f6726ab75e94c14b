/* An emulated V4L2 device for a process started with this library in LD_PRELOAD.
 *
 * open() of the path in GONIO_V4L2_DEVICE connects to the emulated camera that listens on the
 * SOCK_SEQPACKET socket in GONIO_V4L2_SOCKET. The camera answers with an error number (0: opened)
 * and, if opened, two descriptors:
 *   an eventfd, readable while a filled buffer waits: it becomes the application's descriptor, so
 *   that select() and poll() on it are the system's own;
 *   a memory file with the buffers, mapped by mmap() of the application's descriptor.
 * Each ioctl is one message, {request, size, argument}, answered by {error number, argument}.
 * All device behaviour is in the emulated camera; other descriptors go to the system unchanged.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum { MAX_OPEN = 32, MAX_BYTES = 512 };

struct device {
    int descriptor; /* the application's; -1: entry is free */
    int socket;
    int memory;
    int nonblocking;
    pthread_mutex_t exchange; /* held from a request to its answer */
};

struct request {
    uint32_t request;
    uint32_t size;
    char argument[MAX_BYTES];
};

struct answer {
    int32_t error;
    char argument[MAX_BYTES];
};

static struct device devices[MAX_OPEN];
static pthread_mutex_t devices_lock = PTHREAD_MUTEX_INITIALIZER;

static int (*system_open)(const char *, int, ...);
static int (*system_open64)(const char *, int, ...);
static int (*system_openat)(int, const char *, int, ...);
static int (*system_openat64)(int, const char *, int, ...);
static int (*system_ioctl)(int, unsigned long, ...);
static int (*system_close)(int);
static void *(*system_mmap)(void *, size_t, int, int, int, off_t);
static void *(*system_mmap64)(void *, size_t, int, int, int, off64_t);

static pthread_once_t once = PTHREAD_ONCE_INIT;

/* dlsym() returns an object pointer, which ISO C cannot cast to a function pointer. */
static void find_system(void *function, const char *name)
{
    void *found = dlsym(RTLD_NEXT, name);
    memcpy(function, &found, sizeof found);
}

static void prepare(void)
{
    for (int i = 0; i < MAX_OPEN; i++) {
        devices[i].descriptor = -1;
        pthread_mutex_init(&devices[i].exchange, NULL);
    }
    find_system(&system_open, "open");
    find_system(&system_open64, "open64");
    find_system(&system_openat, "openat");
    find_system(&system_openat64, "openat64");
    find_system(&system_ioctl, "ioctl");
    find_system(&system_close, "close");
    find_system(&system_mmap, "mmap");
    find_system(&system_mmap64, "mmap64");
}

static struct device *device_of(int descriptor)
{
    struct device *found = NULL;

    pthread_once(&once, prepare);
    if (descriptor < 0)
        return NULL;
    pthread_mutex_lock(&devices_lock);
    for (int i = 0; i < MAX_OPEN && !found; i++)
        if (devices[i].descriptor == descriptor)
            found = &devices[i];
    pthread_mutex_unlock(&devices_lock);
    return found;
}

static int is_emulated(const char *path)
{
    const char *device = getenv("GONIO_V4L2_DEVICE");

    pthread_once(&once, prepare);
    return device && path && strcmp(device, path) == 0;
}

static int connect_to_camera(void)
{
    const char *path = getenv("GONIO_V4L2_SOCKET");
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int s;

    if (!path || strlen(path) >= sizeof address.sun_path)
        return -1;
    strcpy(address.sun_path, path);
    s = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    if (s >= 0 && connect(s, (struct sockaddr *)&address, sizeof address) == 0)
        return s;
    if (s >= 0)
        system_close(s);
    return -1;
}

/* First message of the camera: 0 and the two descriptors, or the error number of open(). */
static int receive_descriptors(int s, int descriptors[2])
{
    int32_t error = 0;
    char control[CMSG_SPACE(2 * sizeof(int))];
    struct iovec part = {&error, sizeof error};
    struct msghdr message = {.msg_iov = &part,
                             .msg_iovlen = 1,
                             .msg_control = control,
                             .msg_controllen = sizeof control};
    struct cmsghdr *header;

    if (recvmsg(s, &message, MSG_CMSG_CLOEXEC) != (ssize_t)sizeof error)
        return ENODEV;
    if (error)
        return error;
    header = CMSG_FIRSTHDR(&message);
    if (!header || header->cmsg_type != SCM_RIGHTS
        || header->cmsg_len != CMSG_LEN(2 * sizeof(int)))
        return EIO;
    memcpy(descriptors, CMSG_DATA(header), 2 * sizeof(int));
    return 0;
}

static int register_device(int descriptor, int s, int memory, int flags)
{
    int entry = -1;

    pthread_mutex_lock(&devices_lock);
    for (int i = 0; i < MAX_OPEN && entry < 0; i++)
        if (devices[i].descriptor == -1)
            entry = i;
    if (entry >= 0) {
        devices[entry].socket = s;
        devices[entry].memory = memory;
        devices[entry].nonblocking = (flags & O_NONBLOCK) != 0;
        devices[entry].descriptor = descriptor;
    }
    pthread_mutex_unlock(&devices_lock);
    return entry >= 0;
}

static int open_emulated(int flags)
{
    int descriptors[2] = {-1, -1};
    int s = connect_to_camera();
    int error = s < 0 ? ENOENT : receive_descriptors(s, descriptors);

    if (!error && !register_device(descriptors[0], s, descriptors[1], flags)) {
        system_close(descriptors[0]);
        system_close(descriptors[1]);
        error = EMFILE;
    }
    if (!error)
        return descriptors[0];
    if (s >= 0)
        system_close(s);
    errno = error;
    return -1;
}

static mode_t mode_of(int flags, va_list rest)
{
    return (flags & (O_CREAT | O_TMPFILE)) ? va_arg(rest, mode_t) : 0;
}

#define OPEN_LIKE(name)                                                                            \
    int name(const char *path, int flags, ...)                                                     \
    {                                                                                              \
        va_list rest;                                                                              \
        mode_t mode;                                                                               \
        va_start(rest, flags);                                                                     \
        mode = mode_of(flags, rest);                                                               \
        va_end(rest);                                                                              \
        return is_emulated(path) ? open_emulated(flags) : system_##name(path, flags, mode);        \
    }

#define OPENAT_LIKE(name)                                                                          \
    int name(int folder, const char *path, int flags, ...)                                         \
    {                                                                                              \
        va_list rest;                                                                              \
        mode_t mode;                                                                               \
        va_start(rest, flags);                                                                     \
        mode = mode_of(flags, rest);                                                               \
        va_end(rest);                                                                              \
        return is_emulated(path) ? open_emulated(flags)                                            \
                                 : system_##name(folder, path, flags, mode);                       \
    }

OPEN_LIKE(open)
OPEN_LIKE(open64)
OPENAT_LIKE(openat)
OPENAT_LIKE(openat64)

/* Retried after a signal, so that a request always gets its answer. */
static ssize_t send_request(int s, const void *bytes, size_t size)
{
    ssize_t done;

    do
        done = send(s, bytes, size, MSG_NOSIGNAL);
    while (done < 0 && errno == EINTR);
    return done;
}

static ssize_t receive(int s, void *bytes, size_t size)
{
    ssize_t done;

    do
        done = recv(s, bytes, size, 0);
    while (done < 0 && errno == EINTR);
    return done;
}

/* One request and its answer; ENODEV if the camera has gone. */
static int exchange_request(struct device *device, unsigned long request, void *argument)
{
    size_t size = _IOC_SIZE(request), head = offsetof(struct request, argument);
    struct request message = {.request = (uint32_t)request, .size = (uint32_t)size};
    struct answer answer;
    ssize_t received;

    if (size > MAX_BYTES)
        return ENOTTY;
    if (size)
        memcpy(message.argument, argument, size);
    pthread_mutex_lock(&device->exchange);
    received = send_request(device->socket, &message, head + size);
    if (received > 0)
        received = receive(device->socket, &answer, sizeof answer);
    pthread_mutex_unlock(&device->exchange);
    head = offsetof(struct answer, argument);
    if (received < (ssize_t)head)
        return ENODEV;
    if ((_IOC_DIR(request) & _IOC_READ) && received == (ssize_t)(head + size))
        memcpy(argument, answer.argument, size);
    return answer.error;
}

int ioctl(int descriptor, unsigned long request, ...)
{
    struct device *device = device_of(descriptor);
    va_list rest;
    void *argument;
    int error;

    va_start(rest, request);
    argument = va_arg(rest, void *);
    va_end(rest);
    if (!device || _IOC_TYPE(request) != 'V')
        return system_ioctl(descriptor, request, argument);
    error = exchange_request(device, request, argument);
    while (error == EAGAIN && !device->nonblocking) {
        struct pollfd wait = {.fd = descriptor, .events = POLLIN};
        poll(&wait, 1, -1);
        error = exchange_request(device, request, argument);
    }
    if (!error)
        return 0;
    errno = error;
    return -1;
}

#define MMAP_LIKE(name, offset_type)                                                               \
    void *name(void *at, size_t length, int protection, int flags, int descriptor,                 \
               offset_type offset)                                                                 \
    {                                                                                              \
        struct device *device = device_of(descriptor);                                             \
        return system_##name(at, length, protection, flags, device ? device->memory : descriptor,  \
                             offset);                                                              \
    }

MMAP_LIKE(mmap, off_t)
MMAP_LIKE(mmap64, off64_t)

/* Returns once the camera has released what the descriptor held, as close() of a device does. */
static void release(struct device *device)
{
    char rest[MAX_BYTES];

    pthread_mutex_lock(&device->exchange);
    shutdown(device->socket, SHUT_WR);
    while (receive(device->socket, rest, sizeof rest) > 0)
        ;
    pthread_mutex_unlock(&device->exchange);
}

int close(int descriptor)
{
    struct device *device = device_of(descriptor);

    if (device) {
        release(device);
        pthread_mutex_lock(&devices_lock);
        device->descriptor = -1;
        system_close(device->socket);
        system_close(device->memory);
        pthread_mutex_unlock(&devices_lock);
    }
    return system_close(descriptor);
}
