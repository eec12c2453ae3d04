# SPDX-License-Identifier: MIT
# Cortex-M4 with single-precision FPU; sizes as of a drive controller of that class.
set(cortex_flags "-mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard")
set(FIRMWARE_FLASH 512K)
set(FIRMWARE_RAM 64K)
set(FIRMWARE_STACK 4096)
set(FIRMWARE_CLOCK_HZ 25000000)
set(FIRMWARE_FLOAT ON)
set(FIRMWARE_INSTRUCTION_SHIFT 6)
include(${CMAKE_CURRENT_LIST_DIR}/cortex-m.cmake)
