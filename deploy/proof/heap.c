/* Stands in for /dev/dma_heap/system with anonymous memory files, so that libcamera's virtual
 * pipeline runs where the kernel has no such device: LD_PRELOAD=heap.so. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <linux/dma-buf.h>
#include <linux/dma-heap.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>



static int open_heap_or(const char *name, const char *path, int flags, mode_t mode)
{
    if (strcmp(path, "/dev/dma_heap/system") == 0)
        return memfd_create("dma-heap", MFD_CLOEXEC);
    int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, name);
    return real(path, flags, mode);
}

int open(const char *path, int flags, ...)
{
    va_list rest;
    va_start(rest, flags);
    mode_t mode = va_arg(rest, mode_t);
    va_end(rest);
    return open_heap_or("open", path, flags, mode);
}

int open64(const char *path, int flags, ...)
{
    va_list rest;
    va_start(rest, flags);
    mode_t mode = va_arg(rest, mode_t);
    va_end(rest);
    return open_heap_or("open64", path, flags, mode);
}

static int allocate(struct dma_heap_allocation_data *wanted)
{
    int buffer = memfd_create("dma-buffer", MFD_CLOEXEC);
    if (buffer < 0 || ftruncate(buffer, (off_t)wanted->len) < 0)
        return -1;
    wanted->fd = (unsigned)buffer;
    return 0;
}

int ioctl(int fd, unsigned long request, ...)
{
    va_list rest;
    va_start(rest, request);
    void *argument = va_arg(rest, void *);
    va_end(rest);
    if (request == DMA_HEAP_IOCTL_ALLOC)
        return allocate(argument);
    if ((unsigned)request == (unsigned)DMA_BUF_IOCTL_SYNC ||
        (unsigned)request == (unsigned)DMA_BUF_SET_NAME_A ||
        (unsigned)request == (unsigned)DMA_BUF_SET_NAME_B)
        return 0;
    int (*real)(int, unsigned long, ...) = dlsym(RTLD_NEXT, "ioctl");
    return real(fd, request, argument);
}
