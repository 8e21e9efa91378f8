! @signal goValve=0 giState=0
! @at 0.1 giState=5
! @run 0.5
! @line bit 1 TRUE bit 2 FALSE bit 3 TRUE
! @ends goValve=9
MODULE Masks
    VAR byte mask := 0;
    PROC main()
        WaitGI giState, 5;
        TPWrite "bit 1 " + ValToStr(BitCheck(GInput(giState), 1)) + " bit 2 " + ValToStr(BitCheck(GInput(giState), 2)) + " bit 3 " + ValToStr(BitCheck(GInput(giState), 3));
        BitSet mask, 1;
        BitSet mask, 3;
        BitSet mask, 4;
        BitClear mask, 3;
        SetGO goValve, mask;
        Stop;
    ENDPROC
ENDMODULE
