/* Configuration of TinyUSB: one full-speed device port, the vendor's class and CDC-ACM, no operating system.
 */
#pragma once

#ifndef CFG_TUSB_MCU
#define CFG_TUSB_MCU OPT_MCU_NONE /* the controller's driver is the board's own, none of TinyUSB's */
#endif
#define CFG_TUSB_OS OPT_OS_NONE
#define CFG_TUSB_DEBUG 0
#ifndef CFG_TUD_TASK_QUEUE_SZ
#define CFG_TUD_TASK_QUEUE_SZ 8 /* events: the stack runs after each; more where an interrupt makes them */
#endif
#define CFG_TUSB_RHPORT0_MODE (OPT_MODE_DEVICE | OPT_MODE_FULL_SPEED)
#define CFG_TUSB_MEM_SECTION
#define CFG_TUSB_MEM_ALIGN __attribute__((aligned(4)))

/* 0 control, 1 vendor, 2 CDC data, 3 CDC notifications */
#define CFG_TUD_ENDPPOINT_MAX 4
#define CFG_TUD_ENDPOINT0_SIZE 64

/* One packet each: what is behind it waits in the link's own rings, or at the host. */
#define CFG_TUD_VENDOR 1
#define CFG_TUD_VENDOR_EPSIZE 64
#define CFG_TUD_VENDOR_RX_BUFSIZE 64
#define CFG_TUD_CDC 1
#define CFG_TUD_CDC_EP_BUFSIZE 64
#define CFG_TUD_CDC_RX_BUFSIZE 64
#define CFG_TUD_CDC_TX_BUFSIZE 64
