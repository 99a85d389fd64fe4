"""The engine room: numba, LLVM, threads and buffers. Nothing outside knows their inside."""
