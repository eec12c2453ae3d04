# SPDX-License-Identifier: MIT
# Cortex-M3; sizes as of a drive controller of that class.
set(cortex_flags "-mcpu=cortex-m3")
set(FIRMWARE_FLASH 512K)
set(FIRMWARE_RAM 64K)
set(FIRMWARE_STACK 4096)
set(FIRMWARE_CLOCK_HZ 25000000)
set(FIRMWARE_FLOAT ON)
set(FIRMWARE_INSTRUCTION_SHIFT 3)
include(${CMAKE_CURRENT_LIST_DIR}/cortex-m.cmake)
