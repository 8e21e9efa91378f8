! @signal ao1=0
! @run 0.4
! @line above 6.5
! @line above 9
MODULE FlowWatch
    ! an interrupt whenever the flow is above its limit and has changed by more than two
    VAR intnum irFlow;
    PROC main()
        CONNECT irFlow WITH TooMuch;
        ISignalAO ao1,AIO_ABOVE_HIGH,5,0,2,irFlow;
        Ramp [1,4,6.5,7,9,3];
        ISleep irFlow;
        SetAO ao1,9.5;
        WaitTime 0.02;
        Stop;
    ENDPROC
    PROC Ramp(num values{*})
        FOR i FROM 1 TO Dim(values,1) DO
            SetAO ao1,values{i};
            WaitTime 0.02;
        ENDFOR
    ENDPROC
    TRAP TooMuch
        TPWrite "above "+ValToStr(AOutput(ao1));
    ENDTRAP
ENDMODULE
