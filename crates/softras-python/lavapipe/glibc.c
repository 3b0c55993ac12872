// What the linked libraries take from the C library and older ones lack. Hidden, so that nobody else sees it.
#define _GNU_SOURCE
#include <malloc.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#pragma GCC visibility push(hidden)

int stat(const char *path, struct stat *found) { return syscall(SYS_stat, path, found); }
int lstat(const char *path, struct stat *found) { return syscall(SYS_lstat, path, found); }
int fstat(int file, struct stat *found) { return syscall(SYS_fstat, file, found); }
int stat64(const char *path, struct stat64 *found) { return syscall(SYS_stat, path, found); }
int lstat64(const char *path, struct stat64 *found) { return syscall(SYS_lstat, path, found); }
int fstat64(int file, struct stat64 *found) { return syscall(SYS_fstat, file, found); }
int fstatat64(int folder, const char *path, struct stat64 *found, int flags) {
    return syscall(SYS_newfstatat, folder, path, found, flags);
}
int mknod(const char *path, mode_t mode, dev_t device) { return syscall(SYS_mknod, path, mode, device); }
int fcntl64(int file, int command, long value) { return syscall(SYS_fcntl, file, command, value); }
pid_t gettid(void) { return syscall(SYS_gettid); }

// LLVM names temporary files by it.
unsigned arc4random(void) {
    unsigned number = 0;
    syscall(SYS_getrandom, &number, sizeof number, 0);
    return number;
}

// The standard library takes locks unless it is true.
char __libc_single_threaded = 0;

// LLVM prints it beside its own times, which nobody asks for.
struct mallinfo2 mallinfo2(void) { return (struct mallinfo2){0}; }

// LLVM looks for colours of a terminal.
int setupterm(const char *name, int file, int *error) { return -1; }
int tigetnum(const char *name) { return -1; }
void *set_curterm(void *terminal) { return 0; }
int del_curterm(void *terminal) { return -1; }
