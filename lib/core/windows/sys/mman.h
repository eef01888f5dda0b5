/* Stands for the POSIX header of this name: core/os_windows.h declares its content. */
