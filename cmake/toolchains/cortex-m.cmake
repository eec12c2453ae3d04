# SPDX-License-Identifier: MIT
# What the Cortex-M toolchains share: bare metal, newlib's sine and memory functions, no start-up files, no heap.
# -fstack-usage and -fcallgraph-info write beside each object what firmware/report.py adds up.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_C_FLAGS_INIT "-mthumb ${cortex_flags} -ffunction-sections -fdata-sections -fstack-usage -fcallgraph-info=su \
-DSERVOSCOPE_REAL_BITS=32")
