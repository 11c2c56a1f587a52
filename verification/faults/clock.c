/* A separate time of day for a process: preload this library, T2_CLOCK names the file with the step.
 *
 * The time of day changes, and the clock since boot, as if the machine had slept. Waits, timers and
 * the monotonic clock stay the machine's; no T2 process waits until a time of day.
 * The file holds two int64 in nanoseconds, in the machine's byte order: the step of the time of day,
 * and the sleep. It is mapped: a write steps the clocks of all processes that use it, at once.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>

static const int64_t none[2] = {0, 0}, S = 1000000000;
static const volatile int64_t *step_ns = none;
static int (*machine)(clockid_t, struct timespec *);

__attribute__((constructor)) static void begin(void) {
    machine = dlsym(RTLD_NEXT, "clock_gettime");
    const char *name = getenv("T2_CLOCK");
    int file = name ? open(name, O_RDONLY | O_CLOEXEC) : -1;
    void *page = mmap(NULL, sizeof none, PROT_READ, MAP_SHARED, file, 0);
    if (page == MAP_FAILED)
        abort(); /* a trial without a step must not pass */
    step_ns = page;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    if (!machine) /* called by another library's constructor */
        machine = dlsym(RTLD_NEXT, "clock_gettime");
    int error = machine(clock, now);
    int is_of_day = clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE;
    if (!error && (is_of_day || clock == CLOCK_BOOTTIME)) {
        int64_t ns = now->tv_sec * S + now->tv_nsec + step_ns[!is_of_day];
        *now = (struct timespec){ns / S, ns % S};
    }
    return error;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    (void)zone; /* obsolete */
    struct timespec it;
    int error = clock_gettime(CLOCK_REALTIME, &it);
    *now = (struct timeval){it.tv_sec, it.tv_nsec / 1000};
    return error;
}

time_t time(time_t *to) {
    struct timespec it;
    clock_gettime(CLOCK_REALTIME, &it);
    if (to)
        *to = it.tv_sec;
    return it.tv_sec;
}
