// Registers of the STM32G474, as far as they are used here. A namespace has the registers of the peripherals
// that stand before it. host/python/tests/test_registers.py reads this file and looks each of them up in ST's
// SVD file, but for what is marked as not being there: that is from RM0440. A namespace that is another name
// for one of stm32 has its registers from there.
#pragma once

#include "boards/stm32/registers.hpp"

namespace palpate::stm32g4 {

using namespace stm32;  // what this family has as others do

inline constexpr Base RCC{0x40021000};
namespace rcc {
inline constexpr Offset CR{0x00};
inline constexpr Bits CR_HSION{8};
inline constexpr Bits CR_HSIRDY{10};
inline constexpr Bits CR_HSEON{16};
inline constexpr Bits CR_HSERDY{17};
inline constexpr Bits CR_CSSON{19};
inline constexpr Bits CR_PLLON{24};
inline constexpr Bits CR_PLLRDY{25};
inline constexpr Offset CFGR{0x08};
inline constexpr Bits CFGR_SW{0, 2};
inline constexpr Bits CFGR_SWS{2, 2};
inline constexpr Bits CFGR_HPRE{4, 4};
inline constexpr Offset PLLCFGR{0x0C};
inline constexpr Bits PLLCFGR_PLLSRC{0, 2};
inline constexpr Bits PLLCFGR_PLLM{4, 4};
inline constexpr Bits PLLCFGR_PLLN{8, 7};
inline constexpr Bits PLLCFGR_PLLREN{24};
inline constexpr Bits PLLCFGR_PLLR{25, 2};
inline constexpr Offset CIFR{0x1C};
inline constexpr Bits CIFR_CSSF{8};
inline constexpr Offset CICR{0x20};
inline constexpr Bits CICR_CSSC{8};
inline constexpr Offset AHB1ENR{0x48};
inline constexpr Bits AHB1ENR_DMA1EN{0};
inline constexpr Bits AHB1ENR_DMAMUX1EN{2};
inline constexpr Offset AHB2ENR{0x4C};
inline constexpr Bits AHB2ENR_GPIOAEN{0};
inline constexpr Bits AHB2ENR_GPIOBEN{1};
inline constexpr Bits AHB2ENR_GPIOCEN{2};
inline constexpr Bits AHB2ENR_GPIOFEN{5};
inline constexpr Bits AHB2ENR_ADC12EN{13};
inline constexpr Bits AHB2ENR_DAC1EN{16};
inline constexpr Bits AHB2ENR_DAC2EN{17};
inline constexpr Offset APB1ENR1{0x58};
inline constexpr Bits APB1ENR1_TIM2EN{0};
inline constexpr Bits APB1ENR1_TIM3EN{1};
inline constexpr Bits APB1ENR1_TIM4EN{2};
inline constexpr Bits APB1ENR1_TIM5EN{3};
inline constexpr Bits APB1ENR1_TIM6EN{4};
inline constexpr Bits APB1ENR1_TIM7EN{5};
inline constexpr Bits APB1ENR1_CRSEN{8};
inline constexpr Bits APB1ENR1_USBEN{23};
inline constexpr Bits APB1ENR1_FDCANEN{25};
inline constexpr Bits APB1ENR1_PWREN{28};
inline constexpr Offset APB1ENR2{0x5C};
inline constexpr Bits APB1ENR2_LPUART1EN{0};
inline constexpr Offset APB2ENR{0x60};
inline constexpr Bits APB2ENR_SYSCFGEN{0};
inline constexpr Offset CCIPR{0x88};
inline constexpr Bits CCIPR_LPUART1SEL{10, 2};
inline constexpr Bits CCIPR_FDCANSEL{24, 2};
inline constexpr Bits CCIPR_CLK48SEL{26, 2};
inline constexpr Offset CSR{0x94};
inline constexpr Bits CSR_RMVF{23};
inline constexpr Bits CSR_OBLRSTF{25};
inline constexpr Bits CSR_PINRSTF{26};
inline constexpr Bits CSR_BORRSTF{27};
inline constexpr Bits CSR_SFTRSTF{28};
inline constexpr Bits CSR_IWDGRSTF{29};
inline constexpr Bits CSR_WWDGRSTF{30};
inline constexpr Bits CSR_LPWRRSTF{31};
inline constexpr Offset CRRCR{0x98};
inline constexpr Bits CRRCR_HSI48ON{0};
inline constexpr Bits CRRCR_HSI48RDY{1};
}  // namespace rcc

inline constexpr Base PWR{0x40007000};
namespace pwr {
inline constexpr Offset CR1{0x00};
inline constexpr Bits CR1_VOS{9, 2};
inline constexpr Offset CR2{0x04};
inline constexpr Bits CR2_PVDE{0};
inline constexpr Bits CR2_PVDLS{1, 3};
inline constexpr Offset CR3{0x08};
inline constexpr Bits CR3_UCPD1_DBDIS{14};
inline constexpr Offset SR2{0x14};
inline constexpr Bits SR2_VOSF{10};
inline constexpr Bits SR2_PVDO{11};
inline constexpr Offset CR5{0x80};
inline constexpr Bits CR5_R1MODE{8};
}  // namespace pwr

inline constexpr Base FLASH{0x40022000};
namespace flash {
inline constexpr Offset ACR{0x00};
inline constexpr Bits ACR_LATENCY{0, 4};
inline constexpr Bits ACR_PRFTEN{8};
inline constexpr Bits ACR_ICEN{9};
inline constexpr Bits ACR_DCEN{10};
inline constexpr Bits ACR_DCRST{12};
inline constexpr Offset KEYR{0x08};
inline constexpr Offset SR{0x10};
inline constexpr Bits SR_EOP{0};
inline constexpr Bits SR_OPERR{1};
inline constexpr Bits SR_PROGERR{3};
inline constexpr Bits SR_WRPERR{4};
inline constexpr Bits SR_PGAERR{5};
inline constexpr Bits SR_SIZERR{6};
inline constexpr Bits SR_PGSERR{7};
inline constexpr Bits SR_MISSERR{8};
inline constexpr Bits SR_FASTERR{9};
inline constexpr Bits SR_BSY{16};
inline constexpr Offset CR{0x14};
inline constexpr Bits CR_PG{0};
inline constexpr Bits CR_PER{1};
inline constexpr Bits CR_PNB{3, 7};
inline constexpr Bits CR_BKER{11};
inline constexpr Bits CR_STRT{16};  // svd START
inline constexpr Bits CR_LOCK{31};
inline constexpr Offset ECCR{0x18};
inline constexpr Bits ECCR_ECCD{31};
inline constexpr Offset OPTR{0x20};
inline constexpr Bits OPTR_BFB2{20};
inline constexpr Bits OPTR_DBANK{22};
}  // namespace flash

inline constexpr Base GPIOA{0x48000000};
inline constexpr Base GPIOB{0x48000400};
inline constexpr Base GPIOC{0x48000800};
inline constexpr Base GPIOF{0x48001400};
namespace gpio = stm32::gpio;

inline constexpr Base DAC1{0x50000800};
inline constexpr Base DAC2{0x50000C00};
namespace dac {
inline constexpr Offset CR{0x00};
inline constexpr Bits CR_EN1{0};
inline constexpr Bits CR_EN2{16};
inline constexpr Offset DHR12R1{0x08};
inline constexpr Offset DHR12R2{0x14};
inline constexpr Offset DHR12RD{0x20};
inline constexpr Offset MCR{0x3C};
inline constexpr Bits MCR_MODE1{0, 3};
inline constexpr Bits MCR_HFSEL{14, 2};
inline constexpr Bits MCR_MODE2{16, 3};
}  // namespace dac

inline constexpr Base ADC1{0x50000000};
namespace adc {
inline constexpr Offset ISR{0x00};
inline constexpr Bits ISR_ADRDY{0};
inline constexpr Bits ISR_EOS{3};
inline constexpr Bits ISR_OVR{4};
inline constexpr Offset CR{0x08};
inline constexpr Bits CR_ADEN{0};
inline constexpr Bits CR_ADSTART{2};
inline constexpr Bits CR_ADVREGEN{28};
inline constexpr Bits CR_DEEPPWD{29};
inline constexpr Bits CR_ADCAL{31};
inline constexpr Offset CFGR{0x0C};
inline constexpr Bits CFGR_DMAEN{0};
inline constexpr Bits CFGR_DMACFG{1};
inline constexpr Bits CFGR_EXTSEL{5, 5};
inline constexpr Bits CFGR_EXTEN{10, 2};
inline constexpr Offset CFGR2{0x10};
inline constexpr Bits CFGR2_ROVSE{0};
inline constexpr Bits CFGR2_OVSR{2, 3};
inline constexpr Bits CFGR2_OVSS{5, 4};
inline constexpr Offset SMPR1{0x14};
inline constexpr Bits SMPR1_SMP6{18, 3};
inline constexpr Bits SMPR1_SMP7{21, 3};
inline constexpr Bits SMPR1_SMP8{24, 3};
inline constexpr Offset SQR1{0x30};
inline constexpr Bits SQR1_L{0, 4};
inline constexpr Bits SQR1_SQ1{6, 5};
inline constexpr Bits SQR1_SQ2{12, 5};
inline constexpr Bits SQR1_SQ3{18, 5};
inline constexpr Offset DR{0x40};
}  // namespace adc

inline constexpr Base ADC12_Common{0x50000300};
namespace adc_common {
inline constexpr Offset CCR{0x08};
inline constexpr Bits CCR_CKMODE{16, 2};
}  // namespace adc_common

inline constexpr Base DMA1{0x40020000};
namespace dma {
inline constexpr Offset ISR{0x00};
inline constexpr Bits ISR_TCIF1{1};
inline constexpr Bits ISR_HTIF1{2};
inline constexpr Bits ISR_TEIF1{3};
inline constexpr Offset IFCR{0x04};
// Of channel 1; those of channel n are kChannelBytes * (n - 1) behind them, and its flags kChannelFlags times
// as many bits.
inline constexpr Offset CCR1{0x08};
inline constexpr Bits CCR1_EN{0};
inline constexpr Bits CCR1_TCIE{1};
inline constexpr Bits CCR1_HTIE{2};
inline constexpr Bits CCR1_TEIE{3};
inline constexpr Bits CCR1_DIR{4};
inline constexpr Bits CCR1_CIRC{5};
inline constexpr Bits CCR1_MINC{7};
inline constexpr Bits CCR1_PSIZE{8, 2};
inline constexpr Bits CCR1_MSIZE{10, 2};
inline constexpr Bits CCR1_PL{12, 2};
inline constexpr Offset CNDTR1{0x0C};
inline constexpr Offset CPAR1{0x10};
inline constexpr Offset CMAR1{0x14};
inline constexpr std::uint32_t kChannelBytes = 0x14;
inline constexpr std::uint32_t kChannelFlags = 4;
}  // namespace dma

// Channel n of DMA1 is channel n - 1 here.
inline constexpr Base DMAMUX{0x40020800};
namespace dmamux {
inline constexpr Offset C0CR{0x00};
inline constexpr Bits C0CR_DMAREQ_ID{0, 7};
}  // namespace dmamux

inline constexpr Base LPUART1{0x40008000};
namespace lpuart {
inline constexpr Offset CR1{0x00};
inline constexpr Bits CR1_UE{0};
inline constexpr Bits CR1_RE{2};
inline constexpr Bits CR1_TE{3};
inline constexpr Bits CR1_IDLEIE{4};
inline constexpr Bits CR1_FIFOEN{29};
inline constexpr Offset CR3{0x08};
inline constexpr Bits CR3_DMAR{6};
inline constexpr Bits CR3_DMAT{7};
inline constexpr Bits CR3_OVRDIS{12};
inline constexpr Offset BRR{0x0C};
inline constexpr Offset ISR{0x1C};
inline constexpr Bits ISR_IDLE{4};
inline constexpr Offset ICR{0x20};
inline constexpr Bits ICR_PECF{0};
inline constexpr Bits ICR_FECF{1};
inline constexpr Bits ICR_NCF{2};
inline constexpr Bits ICR_ORECF{3};
inline constexpr Bits ICR_IDLECF{4};
inline constexpr Offset RDR{0x24};
inline constexpr Offset TDR{0x28};
}  // namespace lpuart

inline constexpr Base FDCAN2{0x40006800};
namespace fdcan {
inline constexpr Offset DBTP{0x0C};
inline constexpr Bits DBTP_DSJW{0, 4};
inline constexpr Bits DBTP_DTSEG2{4, 4};
inline constexpr Bits DBTP_DTSEG1{8, 5};
inline constexpr Bits DBTP_DBRP{16, 5};
inline constexpr Bits DBTP_TDC{23};
inline constexpr Offset CCCR{0x18};
inline constexpr Bits CCCR_INIT{0};
inline constexpr Bits CCCR_CCE{1};
inline constexpr Bits CCCR_FDOE{8};
inline constexpr Bits CCCR_BRSE{9};
inline constexpr Offset NBTP{0x1C};
inline constexpr Bits NBTP_NTSEG2{0, 7};
inline constexpr Bits NBTP_NTSEG1{8, 8};
inline constexpr Bits NBTP_NBRP{16, 9};
inline constexpr Bits NBTP_NSJW{25, 7};
inline constexpr Offset PSR{0x44};
inline constexpr Bits PSR_BO{7};
inline constexpr Offset TDCR{0x48};
inline constexpr Bits TDCR_TDCO{8, 7};
inline constexpr Offset IR{0x50};
inline constexpr Bits IR_RF0N{0};
inline constexpr Bits IR_RF0L{2};
inline constexpr Bits IR_RF1N{3};
inline constexpr Bits IR_RF1L{5};
inline constexpr Bits IR_TC{7};
inline constexpr Bits IR_BO{19};
inline constexpr Offset IE{0x54};
inline constexpr Bits IE_RF0NE{0};
inline constexpr Bits IE_RF1NE{3};
inline constexpr Bits IE_TCE{7};
inline constexpr Offset ILS{0x58};
inline constexpr Offset ILE{0x5C};
inline constexpr Bits ILE_EINT0{0};
inline constexpr Offset RXGFC{0x80};
inline constexpr Bits RXGFC_RRFE{0};
inline constexpr Bits RXGFC_RRFS{1};
inline constexpr Bits RXGFC_ANFE{2, 2};
inline constexpr Bits RXGFC_ANFS{4, 2};
inline constexpr Bits RXGFC_LSS{16, 5};
inline constexpr Bits RXGFC_LSE{24, 4};
inline constexpr Offset RXF0S{0x90};
inline constexpr Bits RXF0S_F0FL{0, 4};
inline constexpr Bits RXF0S_F0GI{8, 2};
inline constexpr Offset RXF0A{0x94};
inline constexpr Offset RXF1S{0x98};
inline constexpr Bits RXF1S_F1FL{0, 4};
inline constexpr Bits RXF1S_F1GI{8, 2};
inline constexpr Offset RXF1A{0x9C};
inline constexpr Offset TXFQS{0xC4};
inline constexpr Bits TXFQS_TFFL{0, 3};
inline constexpr Bits TXFQS_TFQPI{16, 2};
inline constexpr Offset TXBAR{0xCC};
inline constexpr Offset TXBTIE{0xDC};
}  // namespace fdcan

inline constexpr Base USB_FS_device{0x40005C00};
namespace usb {
inline constexpr Offset EP0R{0x00};  // those of the endpoints 1 to 7 follow
inline constexpr Bits EP0R_EA{0, 4};
inline constexpr Bits EP0R_STAT_TX{4, 2};
inline constexpr Bits EP0R_DTOG_TX{6};
inline constexpr Bits EP0R_CTR_TX{7};
inline constexpr Bits EP0R_EP_KIND{8};
inline constexpr Bits EP0R_EP_TYPE{9, 2};
inline constexpr Bits EP0R_SETUP{11};
inline constexpr Bits EP0R_STAT_RX{12, 2};
inline constexpr Bits EP0R_DTOG_RX{14};
inline constexpr Bits EP0R_CTR_RX{15};
inline constexpr Offset CNTR{0x40};
inline constexpr Bits CNTR_FRES{0};
inline constexpr Bits CNTR_FSUSP{3};
inline constexpr Bits CNTR_RESETM{10};
inline constexpr Bits CNTR_SUSPM{11};
inline constexpr Bits CNTR_WKUPM{12};
inline constexpr Bits CNTR_CTRM{15};
inline constexpr Offset ISTR{0x44};
inline constexpr Bits ISTR_EP_ID{0, 4};
inline constexpr Bits ISTR_RESET{10};
inline constexpr Bits ISTR_SUSP{11};
inline constexpr Bits ISTR_WKUP{12};
inline constexpr Bits ISTR_CTR{15};
inline constexpr Offset DADDR{0x4C};
inline constexpr Bits DADDR_ADD{0, 7};
inline constexpr Bits DADDR_EF{7};
inline constexpr Offset BTABLE{0x50};
inline constexpr Offset BCDR{0x58};   // not in the SVD
inline constexpr Bits BCDR_DPPU{15};  // not in the SVD
}  // namespace usb

inline constexpr Base CRS{0x40002000};
namespace crs {
inline constexpr Offset CR{0x00};
inline constexpr Bits CR_CEN{5};
inline constexpr Bits CR_AUTOTRIMEN{6};
inline constexpr Offset CFGR{0x04};
inline constexpr Bits CFGR_RELOAD{0, 16};
inline constexpr Bits CFGR_FELIM{16, 8};
inline constexpr Bits CFGR_SYNCSRC{28, 2};
}  // namespace crs

// Memory of peripherals.
inline constexpr std::uintptr_t kFdcanMessageRam_address = 0x4000A400;  // svd FDCAN
inline constexpr std::uintptr_t kUsbPacketMemory_address = 0x40006000;  // not in the SVD
inline constexpr std::uintptr_t kUniqueId_address = 0x1FFF7590;         // not in the SVD; 96 bits
inline constexpr std::uintptr_t kFlash_address = 0x08000000;
inline constexpr std::uint32_t kFlash_bytes = 512 * 1024;

// Interrupts by position in the vector table.
namespace interrupt {
inline constexpr std::uint32_t DMA1_CH1 = 11;
inline constexpr std::uint32_t DMA1_CH2 = 12;
inline constexpr std::uint32_t USB_LP = 20;
inline constexpr std::uint32_t TIM7 = 55;
inline constexpr std::uint32_t FDCAN2_IT0 = 86;
inline constexpr std::uint32_t LPUART = 91;
}  // namespace interrupt
inline constexpr std::uint32_t kInterrupts = 102;

}  // namespace palpate::stm32g4
