/* A disk that hangs: fsync and fdatasync wait while the file named by GONIO_HUNG_DISK is there.
 *
 * The wait is one that no signal but SIGKILL ends, as for a real disk (state D): that of the caller
 * of vfork for the end of its child. Preload it. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <signal.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

static void wait_for_the_disk(void)
{
    const char *path = getenv("GONIO_HUNG_DISK");
    const struct timespec tick = {0, 2000000};
    sigset_t all;

    if (path == NULL || access(path, F_OK) != 0 || vfork() != 0)
        return;
    sigfillset(&all); /* the child has the caller's memory, but must not run its handlers */
    sigprocmask(SIG_BLOCK, &all, NULL);
    while (access(path, F_OK) == 0)
        nanosleep(&tick, NULL);
    _exit(0);
}

int fsync(int descriptor)
{
    static int (*real)(int);

    if (real == NULL)
        real = (int (*)(int))dlsym(RTLD_NEXT, "fsync");
    wait_for_the_disk();
    return real(descriptor);
}

int fdatasync(int descriptor)
{
    static int (*real)(int);

    if (real == NULL)
        real = (int (*)(int))dlsym(RTLD_NEXT, "fdatasync");
    wait_for_the_disk();
    return real(descriptor);
}
