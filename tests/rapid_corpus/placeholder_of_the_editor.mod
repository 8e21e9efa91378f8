! @run 0.3
! @line template
! @value n 1
MODULE Template
    <DDN>
    VAR num n := 0;
    PROC main()
        Incr n;
        TPWrite "template";
        Stop;
        <SMT>
    ENDPROC
    <RDN>
ENDMODULE
