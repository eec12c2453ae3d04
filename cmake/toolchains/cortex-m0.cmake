# SPDX-License-Identifier: MIT
# Cortex-M0, no multiply to 64 bits, no floating point; an nRF51 as the microbit has it (16 KiB of RAM).
set(cortex_flags "-mcpu=cortex-m0")
set(FIRMWARE_FLASH 256K)
set(FIRMWARE_RAM 16K)
set(FIRMWARE_STACK 2048)
set(FIRMWARE_CLOCK_HZ 16000000)
set(FIRMWARE_FLOAT OFF)
set(FIRMWARE_INSTRUCTION_SHIFT 0)
include(${CMAKE_CURRENT_LIST_DIR}/cortex-m.cmake)
